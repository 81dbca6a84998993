// A summary of a site's map at one moment, and the versions to which it can be switched.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/service/generation.h"
#include "common/service/names.h"

namespace cairn {

struct MapVersionInfo {
  std::uint32_t version = 0;  // 1: the live map since the site began. Jobs add more.
  bool enabled = false;
  std::uint64_t job = 0;  // The job that made it; 0 for the live map.
  std::string note;
};

// MapInfo::memory_note begins with this while the map takes more than it may although it has given up all that it can.
inline constexpr std::string_view kAboveMemoryLimit = "above the limit of memory";

struct MapInfo {
  NameId site_id = 0;
  std::string site;
  double resolution_m = 0.05;  // Cell size of level 0.
  std::uint32_t epoch = 0;     // Wholesale changes so far; tiles of older epochs are void.
  std::uint64_t version = 0;   // Highest tile version.
  std::uint32_t levels = 0;
  std::uint32_t tile_count = 0;                               // Level 0.
  double x_min_m = 0, y_min_m = 0, x_max_m = 0, y_max_m = 0;  // Bounds of level-0 tiles; all 0 while empty.
  std::uint32_t robots = 0;                                   // Sessions in the site.
  std::uint32_t enabled_version = 1;
  std::vector<MapVersionInfo> versions;
  std::uint64_t edits_version = 0;  // Grows with every change of the edits (map_edit.h); 0: there was none.
  // What the site's tiles, grids and versions take in the server's memory. Shared parts count once.
  std::uint64_t memory_bytes = 0;
  std::string memory_note = {};  // What was given up to stay below maps.max_memory_mib; empty: nothing.
  Generation generation = 0;     // Set by the server's egress.
};

}  // namespace cairn
