// The result of an operation that depends on the outside (network, disk, configuration): a value or a Status.
// Codes are gRPC's, so a reply on the wire carries the same number. Thread-safe (plain values).
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace cairn {

enum class StatusCode : int {
  kOk = 0,
  kCancelled = 1,
  kUnknown = 2,
  kInvalidArgument = 3,
  kDeadlineExceeded = 4,
  kNotFound = 5,
  kAlreadyExists = 6,
  kPermissionDenied = 7,
  kResourceExhausted = 8,
  kFailedPrecondition = 9,
  kAborted = 10,
  kOutOfRange = 11,
  kUnimplemented = 12,
  kInternal = 13,
  kUnavailable = 14,
  kDataLoss = 15,
};

// The code's gRPC name in upper case, e.g. "NOT_FOUND"; "UNKNOWN" for a number outside the list.
[[nodiscard]] std::string_view StatusCodeName(StatusCode code);

struct [[nodiscard]] Status {
  StatusCode code = StatusCode::kOk;
  std::string message;  // For a person: what was wrong, with the offending value.
  // Of a question or command to a server that failed: the id under which the server logs it (service/request_id.h).
  std::string request = {};

  [[nodiscard]] bool ok() const { return code == StatusCode::kOk; }
};

template <typename T>
using Result = tl::expected<T, Status>;

[[nodiscard]] inline tl::unexpected<Status> Fail(StatusCode code, std::string message) {
  return tl::unexpected<Status>(Status{code, std::move(message)});
}

}  // namespace cairn
