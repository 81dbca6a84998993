// JSON output of the tools: one object on one line. Numbers that are not finite become null. Bytes that are
// not UTF-8 (for example in a file name) are replaced. Stateless, thread-safe.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "common/status.h"

namespace cairn::server {

using Json = nlohmann::ordered_json;  // Members are printed in the order in which they were added.

[[nodiscard]] inline std::string JsonLine(const Json& object) {
  return object.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}
// The object for a failure, the same as that of `cairn --json`: {"error":{"code":...,"message":...}}.
[[nodiscard]] inline std::string ErrorJson(const Status& status) {
  return JsonLine({{"error", {{"code", StatusCodeName(status.code)}, {"message", status.message}}}});
}

}  // namespace cairn::server
