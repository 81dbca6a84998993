// How well rays agree with a map: the logarithm of (3.39) for a ray that hit something, of the chance to pass for one
// that did not, summed over the rays (they are independent given pose and map). A share of outliers keeps a single
// person in the way from sinking a particle.
// Space never seen neither stops a ray on its way nor speaks against an end in it: there every end has the same
// density, about that of a ray well explained. (With a prior opacity for it, as for seen cells, a ray into the unknown
// scores worse than one on a known wall, which should favour poses that lag behind; how much that costs is not
// measured.) Cells farther than 4 sigma from the measured end cannot explain it: before them only the way through
// counts, and the ray is followed no farther. Stateless, thread-safe. Source: thesis C 3.2.3.1; the textbook form is
// opacity.h.
#pragma once

#include <cstddef>

#include "common/geometry/pose2.h"
#include "server/slam/dpslam/laser_rays.h"
#include "server/slam/dpslam/opacity_window.h"

namespace cairn::slam {

struct RayModel {
  double sigma_m = 0.05;        // Of a range, with what the grid's coarseness adds.
  double outlier_share = 0.05;  // Rays that say nothing about the map.
  double outlier_m = 20.0;      // Over which their ranges are spread.
  double resolution_m = 0.05;
  double unseen_per_m = 2.0;  // Density of ends in space never seen.
};

// How a ray of the model is seen in a map, one by one, and over every `stride`-th ray from `first`.
[[nodiscard]] double RayLikelihood(const OpacityWindow& window, const Pose2& T_map_robot,
                                   const Eigen::Vector2d& origin_robot, const LaserRay& ray, const RayModel& model);
[[nodiscard]] double LogLikelihood(const OpacityWindow& window, const Pose2& T_map_robot, const LaserRays& rays,
                                   std::size_t first, std::size_t stride, const RayModel& model);
// The same where nothing has been seen yet.
[[nodiscard]] double UnseenLogLikelihood(const LaserRays& rays, std::size_t stride, const RayModel& model);

}  // namespace cairn::slam
