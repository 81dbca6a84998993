// How landmarks are found and recognised, shared by every filter that uses them.
// Source: thesis A 4.4 (gates), (4-4) (noise).
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

// Standard deviations of a landmark as one scan shows it.
struct LandmarkNoise {
  double range_m = 0.10;
  double bearing_rad = 0.03;
  double slope_rad = 0.05;  // Of its line's direction.
};

struct LandmarkOptions {
  bool enabled = true;
  LandmarkNoise noise;
  // From feature to candidate.
  std::int64_t min_sightings = 3;        // Keyframes that must show a feature before it can be a landmark.
  double same_distance_m = 0.20;         // Two sightings of one candidate differ by less than this ...
  double same_angle_rad = Radians(8.0);  // ... in slope and corner angle, ...
  double same_length_m = 0.25;           // ... and in a line's length.
  double crowded_m = 0.6;                // Like features nearer to each other are nobody's landmark.
  double forget_m = 10.0;                // Travelled since a candidate's last sighting.
  // From candidate to landmark.
  double match_distance_m = 0.8;  // Between a stable feature and the landmark it may be.
  double match_slope_rad = Radians(12.0);
  double match_share = 0.9975;  // Of true matches that pass the gate on the squared Mahalanobis distance.
  double min_travel_m = 5.0;    // Since the landmark's last observation: a feature in view counts once.
};
void Visit(OptionVisitor& visitor, LandmarkOptions& options);

}  // namespace cairn::slam
