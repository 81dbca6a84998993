// The files of a bag in the order of time: those that the folder's metadata.yaml names, or the file itself.
#pragma once

#include <filesystem>
#include <vector>

#include "common/status.h"

namespace cairn::bag {

// The names in metadata.yaml are looked for in the folder itself, wherever they point to. Of a file that was compressed
// as a whole, its unpacked twin counts where that lies beside it.
[[nodiscard]] Result<std::vector<std::filesystem::path>> FilesOf(const std::filesystem::path& bag);

}  // namespace cairn::bag
