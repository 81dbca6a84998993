// Options for finding and recognising landmarks, shared by every filter that uses them.
// Source: thesis A 4.4 (gates), (4-4) (noise).
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

// Standard deviations of one observation of a landmark.
struct LandmarkNoise {
  double range_m = 0.10;
  double bearing_rad = 0.03;
  double slope_rad = 0.05;
};

// A feature and the landmark that it may be lie at most this far apart. Half or twice the value changes the errors no
// more than another seed (study `sensitivity`).
inline constexpr double kMatchDistanceM = 0.8;

struct LandmarkOptions {
  bool enabled = true;
  LandmarkNoise noise;
  // From feature to candidate.
  std::int64_t min_sightings = 3;
  double same_distance_m = 0.20;
  double same_angle_rad = Radians(8.0);
  double same_length_m = 0.25;
  double crowded_m = 0.6;
  double forget_m = 10.0;
  // From candidate to landmark.
  double match_slope_rad = Radians(12.0);
  double match_share = 0.9975;
  double min_travel_m = 5.0;
};
void Visit(OptionVisitor& visitor, LandmarkOptions& options);

}  // namespace cairn::slam
