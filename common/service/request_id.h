// The number by which a request is called in errors of programs and in the logs of all programs that it passed through.
// Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "common/service/session.h"

namespace cairn {

// The last eight hexadecimal digits of a client's id, which are enough to tell the clients of a log apart.
[[nodiscard]] std::string ShortClientId(ClientId client);
// The client and the number that it has given to the request: "1a2b3c4d-7".
[[nodiscard]] std::string RequestId(ClientId client, std::int64_t sequence);

}  // namespace cairn
