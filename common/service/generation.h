// The number of a start of the server.
#pragma once

#include <cstdint>

namespace cairn {

// Grows from start to start of a server, whichever way the one before ended, and is never 0. Epochs, versions and
// numbers of two generations must not be compared: a receiver that hears of a higher generation begins anew, and
// ignores values of a lower one.
using Generation = std::uint64_t;

}  // namespace cairn
