// The files of the page, which the build puts into the program (embed.cmake): those of page/, and Leaflet from its
// Debian package.
#pragma once

#include <span>
#include <string_view>

namespace cairn::web {

struct PageFile {
  std::string_view name;
  std::string_view bytes;
};

[[nodiscard]] std::span<const PageFile> PageFiles();

}  // namespace cairn::web
