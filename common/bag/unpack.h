// Compressed parts of bags. The result is bounded by what the caller allows, whatever the bytes say of themselves.
// Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/status.h"

namespace cairn::bag {

// `size` bytes from a part whose compression MCAP names: "" (none), "lz4" (its frame format) or "zstd". The caller has
// bounded the size. DATA_LOSS: it does not unpack to exactly so many. UNIMPLEMENTED: another compression.
[[nodiscard]] Result<std::string> Unpack(std::string_view stored, std::string_view compression, std::size_t size);

// A message that rosbag2 has compressed by itself begins as a frame of zstd does, which no other message does.
[[nodiscard]] bool IsZstd(std::string_view bytes);
// At most `max_bytes`.
[[nodiscard]] Result<std::string> UnpackZstd(std::string_view stored, std::size_t max_bytes);

// CRC-32 as zlib and MCAP have it; `before` is that of the bytes before these.
[[nodiscard]] std::uint32_t Crc32(std::string_view bytes, std::uint32_t before = 0);

}  // namespace cairn::bag
