// Files of bags that were compressed as a whole with zstd (`ros2 bag record --compression-mode file`): an MCAP file or
// a database of SQLite inside. Neither can be read from its beginning to its end only, so it is unpacked into a file of
// the directory for temporary files (TMPDIR chooses it), which has lost its name by the time it is read: it goes with
// the program, however that ends. Memory does not grow with the file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "common/bag/bag_file.h"

namespace cairn::bag {

// A file may unpack to `bytes`, or to `times_length` times its own length where that is more: a small file must not
// fill a disk. Logs of robots are packed to a third or a tenth.
struct PackedLimits {
  std::uint64_t bytes = std::uint64_t{1} << 30;
  std::uint64_t times_length = 100;
};

// kDataLoss: it cannot be unpacked. kResourceExhausted: it is too long, or there is no room for it.
[[nodiscard]] Result<std::unique_ptr<File>> OpenPacked(const std::filesystem::path& path,
                                                       const PackedLimits& limits = {});

}  // namespace cairn::bag
