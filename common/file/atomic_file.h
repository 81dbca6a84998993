// Writes files so that they are complete or absent: beside the target, flushed to the disk, then renamed over it.
// Not for a file that two programs write at once: the last rename wins. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace cairn {

// Survives a crash at any moment: afterwards the path holds the old content or the new. Leaves no temporary file
// behind on failure. The directory must exist.
[[nodiscard]] Result<void> WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

// The whole content; kNotFound, or kResourceExhausted if it is longer than `max_bytes`.
[[nodiscard]] Result<std::vector<std::uint8_t>> ReadWholeFile(const std::filesystem::path& path, std::size_t max_bytes);

}  // namespace cairn
