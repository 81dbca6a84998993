#include "server/slam/filters/landmark_options.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, LandmarkOptions& options) {
  visitor.Flag("enabled", options.enabled, "Use corners and lines ended on both sides as landmarks.");
  visitor.Real("range_m", options.noise.range_m, "m", 0.001, 5.0, "Noise of a landmark's range.");
  visitor.Real("bearing_rad", options.noise.bearing_rad, "rad", 0.0001, 1.0, "Noise of a landmark's bearing.");
  visitor.Real("slope_rad", options.noise.slope_rad, "rad", 0.0001, 1.0, "Noise of a landmark's direction.");
  visitor.Integer("min_sightings", options.min_sightings, "1", 1, 100,
                  "Keyframes that must show a feature before it can be a landmark.");
  visitor.Real("same_distance_m", options.same_distance_m, "m", 0.01, 5.0, "Between two sightings of one feature.");
  visitor.Real("same_angle_rad", options.same_angle_rad, "rad", 0.001, 1.0, "... in slope and corner angle.");
  visitor.Real("same_length_m", options.same_length_m, "m", 0.01, 5.0, "... in a line's length.");
  visitor.Real("crowded_m", options.crowded_m, "m", 0.0, 10.0,
               "Like features nearer to each other are nobody's landmark.");
  visitor.Real("forget_m", options.forget_m, "m", 0.1, 1000.0, "Travelled since a candidate's last sighting.");
  visitor.Real("match_distance_m", options.match_distance_m, "m", 0.01, 10.0,
               "Between a stable feature and the landmark it may be.");
  visitor.Real("match_slope_rad", options.match_slope_rad, "rad", 0.001, 1.6, "... and their slopes, side by side.");
  visitor.Real("match_share", options.match_share, "1", 0.5, 0.999999,
               "Share of true matches that pass the gate on the squared Mahalanobis distance.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Since the landmark's last observation: a feature in view counts once.");
}

}  // namespace cairn::slam
