// The number of a start of the server.
#pragma once

#include <cstdint>

namespace cairn {

// Each start of a server has a higher generation than the one before, however that ended; 0 is not used. Epochs,
// versions and numbers of different generations must not be compared: a receiver of a higher generation discards what
// it had, and ignores values of lower ones.
using Generation = std::uint64_t;

}  // namespace cairn
