// Areas of questions: checks and membership. An area of all zeros means everywhere. Stateless, thread-safe.
#pragma once

#include <cmath>

#include "common/service/request.h"

namespace cairn::server {

[[nodiscard]] inline bool IsEverywhere(const Area& area) {
  return area.x_min_m == 0 && area.y_min_m == 0 && area.x_max_m == 0 && area.y_max_m == 0;
}

[[nodiscard]] inline bool IsValid(const Area& area) {
  const bool finite = std::isfinite(area.x_min_m) && std::isfinite(area.y_min_m) && std::isfinite(area.x_max_m) &&
                      std::isfinite(area.y_max_m);
  return finite && area.x_min_m <= area.x_max_m && area.y_min_m <= area.y_max_m;
}

// Touching edges count.
[[nodiscard]] inline bool Overlap(const Area& a, const Area& b) {
  return a.x_min_m <= b.x_max_m && b.x_min_m <= a.x_max_m && a.y_min_m <= b.y_max_m && b.y_min_m <= a.y_max_m;
}

}  // namespace cairn::server
