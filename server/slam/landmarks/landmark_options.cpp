#include "server/slam/landmarks/landmark_options.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, LandmarkOptions& options) {
  visitor.Flag("enabled", options.enabled, "Whether corners, and lines with both ends visible, are used as landmarks.");
  visitor.Real("range_m", options.noise.range_m, "m", 0.001, 5.0,
               "Standard deviation of the range of an observed landmark.");
  visitor.Real("bearing_rad", options.noise.bearing_rad, "rad", 0.0001, 1.0,
               "Standard deviation of the bearing of an observed landmark.");
  visitor.Real("slope_rad", options.noise.slope_rad, "rad", 0.0001, 1.0,
               "Standard deviation of the direction of an observed landmark.");
  visitor.Integer("min_sightings", options.min_sightings, "1", 1, 100,
                  "Number of keyframes in which a feature must be seen before it can become a landmark. More gives "
                  "fewer and more reliable landmarks.");
  visitor.Real("same_distance_m", options.same_distance_m, "m", 0.01, 5.0,
               "Two sightings of one feature lie at most this far apart.");
  visitor.Real("same_angle_rad", options.same_angle_rad, "rad", 0.001, 1.0,
               "Two sightings of one feature differ at most by this in direction and in the angle of the corner.");
  visitor.Real("same_length_m", options.same_length_m, "m", 0.01, 5.0,
               "Two sightings of one line differ at most by this in length.");
  visitor.Real("crowded_m", options.crowded_m, "m", 0.0, 10.0,
               "Similar features that are nearer to each other than this do not become landmarks, because they could "
               "be confused.");
  visitor.Real("forget_m", options.forget_m, "m", 0.1, 1000.0,
               "A feature that is not yet a landmark is forgotten when the robot has travelled this far since it was "
               "last seen.");
  visitor.Real("match_slope_rad", options.match_slope_rad, "rad", 0.001, 1.6,
               "A feature and the landmark that it may be differ at most by this in direction.");
  visitor.Real("match_share", options.match_share, "1", 0.5, 0.999999,
               "Probability with which a true match passes the gate on the squared Mahalanobis distance. A larger "
               "value accepts more true and more false matches.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "A landmark that stays in view is observed again only after this way.");
}

}  // namespace cairn::slam
