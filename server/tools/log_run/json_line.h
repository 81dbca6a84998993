// JSON output of the tools: one object on one line. Numbers that are not finite become null. Bytes that are
// not UTF-8 (for example in a file name) are replaced. Stateless, thread-safe.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "common/status.h"

namespace cairn::server {

using Json = nlohmann::ordered_json;  // Members are printed in the order in which they were added.

[[nodiscard]] std::string JsonLine(const Json& object);
// The object for a failure, the same as that of `cairn --json`: {"error":{"code":...,"message":...}}.
[[nodiscard]] std::string ErrorJson(const Status& status);

}  // namespace cairn::server
