// Reads MCAP files: chunks that are compressed with zstd or lz4 or not at all, and messages outside of chunks. The
// index and the summary are not used, because files need not have them, and a file whose end is missing (the recorder
// was killed) has none: what is there is read, and a note says where it ends. Damage within is an error: a checksum
// that is wrong, a record that does not fit, a message on a channel that was not announced.
//
// Opening reads the whole file once: it finds the topics, checks every chunk and its checksum, and notes the time of
// the first message of each chunk. Reading then opens chunks in the order of these times, and mixes the messages of
// chunks that overlap. So the memory is that of the chunks that overlap at one time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "common/bag/bag_file.h"

namespace cairn::bag {

struct McapLimits {
  // Of one chunk unpacked, and of a record outside of chunks. Recorders make chunks of 1 to 8 MiB; a chunk of one cloud
  // of points or one picture may be longer.
  std::uint64_t chunk_bytes = std::uint64_t{128} << 20;
  // Of all chunks that overlap at one time.
  std::uint64_t open_bytes = std::uint64_t{512} << 20;
  // Of the whole file unpacked: so much, and so many times the length of the file. A small file must not keep the
  // reader busy for hours; 1000 is more than maps and scans can be compressed.
  std::uint64_t unpacked_bytes = std::uint64_t{1} << 30;
  std::uint64_t times_length = 1000;
};

[[nodiscard]] Result<std::unique_ptr<File>> OpenMcap(const std::filesystem::path& path, const McapLimits& limits = {});

}  // namespace cairn::bag
