// Where the published robot logs are: $CAIRN_DATA, or ../shared/data beside the source tree. They are not part of the
// repository.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace cairn {

inline std::filesystem::path RealLog(const std::string& name) {
  const char* directory = std::getenv("CAIRN_DATA");
  if (directory != nullptr) return std::filesystem::path(directory) / name;
  // Set by ctest. Not compiled in: that would tie cached objects to one clone.
  const char* source = std::getenv("CAIRN_SOURCE_DIR");
  return std::filesystem::path(source != nullptr ? source : ".") / "../shared/data" / name;
}

}  // namespace cairn
