// How well rays agree with a map: the sum over the rays (which are independent given pose and map) of the
// logarithm of (3.39) for a ray with a hit, and of the probability to pass for a ray without. A share of
// outliers prevents a single person in view from removing a particle.
// Unseen space neither stops a ray nor makes a hit in it unlikely: there every hit has the same density,
// about that of a well explained ray. (With a prior opacity for unseen cells, a ray into unknown space has a
// lower likelihood than one on a known wall, which should favour poses that lag behind; the size of this
// effect has not been measured.) Cells farther than 4 sigma from the measured end cannot explain it: before
// them only the probability to pass counts, and behind them the ray is not followed.
// Stateless, thread-safe. Source: thesis C 3.2.3.1; the textbook form is the oracle of its test.
#pragma once

#include <cstddef>

#include "common/geometry/pose2.h"
#include "server/slam/dpslam/laser_rays.h"
#include "server/slam/dpslam/opacity_window.h"

namespace cairn::slam {

struct RayModel {
  double sigma_m = 0.05;        // Standard deviation of a range, including the grid's resolution.
  double outlier_share = 0.05;  // Share of rays that do not depend on the map.
  double outlier_m = 20.0;      // Interval over which the ranges of outliers are uniform.
  double resolution_m = 0.05;
  double unseen_per_m = 2.0;  // Density of hits in unseen space.
};

// Likelihood of one ray in a map, and log likelihood of every `stride`-th ray beginning with `first`.
[[nodiscard]] double RayLikelihood(const OpacityWindow& window, const Pose2& T_map_robot,
                                   const Eigen::Vector2d& origin_robot, const LaserRay& ray, const RayModel& model);
[[nodiscard]] double LogLikelihood(const OpacityWindow& window, const Pose2& T_map_robot, const LaserRays& rays,
                                   std::size_t first, std::size_t stride, const RayModel& model);
// The same for a map in which nothing has been seen yet.
[[nodiscard]] double UnseenLogLikelihood(const LaserRays& rays, std::size_t stride, const RayModel& model);

}  // namespace cairn::slam
