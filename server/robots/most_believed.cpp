#include "server/robots/most_believed.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace cairn::server {
namespace {

constexpr double kNear_m = 0.2, kNear_rad = 0.1;
constexpr std::size_t kMostPlaces = 64;  // Particles that are spread farther do not say where the robot is.

bool AreNear(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).squaredNorm() < kNear_m * kNear_m &&
         std::abs(AngleDiff(a.theta, b.theta)) < kNear_rad;
}

}  // namespace

std::vector<PoseHypothesis> MostBelieved(std::span<const slam::WeightedPose> belief, Stamp stamp) {
  std::vector<slam::WeightedPose> poses(belief.begin(), belief.end());
  std::ranges::stable_sort(poses, std::greater<>(), &slam::WeightedPose::weight);
  std::vector<PoseHypothesis> places;
  for (const slam::WeightedPose& pose : poses) {
    const auto place = std::ranges::find_if(
        places, [&](const PoseHypothesis& one) { return AreNear(one.T_map_robot, pose.T_map_robot); });
    if (place != places.end()) {
      place->weight += pose.weight;
    } else if (places.size() < kMostPlaces) {
      places.push_back({stamp, pose.T_map_robot, pose.weight});
    }
  }
  std::ranges::stable_sort(places, std::greater<>(), &PoseHypothesis::weight);
  if (places.size() > kMostHypotheses) places.resize(kMostHypotheses);
  return places;
}

}  // namespace cairn::server
