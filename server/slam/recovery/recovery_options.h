// What it takes to believe where a robot is that was not watched all the time. Only those are keys of the configuration
// that matter; `cairn-study moved --only constants` halves and doubles each of them.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::slam {

// When a place found in the map counts (place_search.h).
struct PlaceSearchOptions {
  double cell_scale = 2.0;
  double map_reach_m = 300.0;  // A robot is looked for within this distance of its last pose in its map.
  double min_explained = 0.7;
  std::int64_t min_compared = 20;   // Points that must be compared for an agreement to count.
  std::int64_t near_keyframes = 4;  // Old keyframes that a scan is compared with, ...
  double apart_m = 1.0;             // ... so far apart along the path.
  // Largest share of the points compared that may contradict a place. In the worlds of the study `moved` true places
  // have 0.00, and false ones, which look like them, from 0.05 on.
  double max_conflict = 0.03;
  // How far from the place that somebody has said the robot may be.
  double near_m = 1.0;
  double near_rad = 0.5;
};

struct RecoveryOptions {
  PlaceSearchOptions place;
  // A place found this near to the path, and with this heading, is the one on the path.
  double on_path_m = 0.3;
  double on_path_rad = 0.1;
  // A robot has not moved if its odometry has changed by less than this, and at least this share of the beams shows the
  // same range. Along a corridor more beams must show the same, because most do so everywhere along it.
  double still_m = 0.02;
  double still_rad = 0.02;
  double same_range_m = 0.1;
  double same_range_per_m = 0.01;
  double unchanged = 0.95;
  double unchanged_along_corridor = 0.98;
  // The longest pause after which scan, odometry and map together may confirm the place at once, and the largest
  // difference between scan and odometry then.
  double short_pause_s = 10.0;
  double as_odometry_m = 0.15;
  double as_odometry_per_m = 0.1;
  double as_odometry_rad = 0.1;
};
void Visit(OptionVisitor& visitor, RecoveryOptions& options);

}  // namespace cairn::slam
