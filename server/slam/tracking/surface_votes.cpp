#include "server/slam/tracking/surface_votes.h"

#include <algorithm>
#include <cmath>

#include "common/geometry/transform2.h"

namespace cairn::slam {
namespace {

constexpr double kReachM = 0.5;          // A reference point farther away is none.
constexpr double kGapM = 0.3;            // Between two points of one surface, at most.
constexpr double kFacing = 0.5;          // Cosine between the normal of a surface that votes and the line, at least.
constexpr double kClearlyNearer = 0.25;  // Share of the distance between the poses.
constexpr double kWideM = 1.0;           // Robots and people are smaller.
constexpr int kMinPoints = 2;

double DistanceAt(const SurfacePoint& point, const PointIndex& reference, const Pose2& T_ref_robot) {
  const Eigen::Vector2d p_ref = T_ref_robot * point.p;
  const SurfacePoint* const nearest = reference.Nearest(p_ref, kReachM);
  if (nearest == nullptr) return kReachM;
  if (!nearest->smooth() || !point.smooth()) return (p_ref - nearest->p).norm();
  if (nearest->normal.dot(T_ref_robot.rotation() * point.normal) < kFacing) return kReachM;
  return std::abs(nearest->normal.dot(p_ref - nearest->p));
}

struct Surface {
  int points = 0;
  double gain_m = 0.0;  // Sum of the distances at the first pose minus those at the second one.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero(), end = Eigen::Vector2d::Zero();

  [[nodiscard]] int Vote(double clearly_m) const {
    if (points < kMinPoints || std::abs(gain_m) < clearly_m * points) return 0;
    const int weight = (end - begin).norm() >= kWideM ? 2 : 1;
    return gain_m > 0.0 ? weight : -weight;
  }
};

}  // namespace

int SurfaceVotes(std::span<const SurfacePoint> points_robot, const PointIndex& reference, const Pose2& T_ref_first,
                 const Pose2& T_ref_second) {
  const Eigen::Vector2d apart = T_ref_second.translation() - T_ref_first.translation();
  const double clearly_m = kClearlyNearer * apart.norm();
  const Eigen::Vector2d along = T_ref_first.rotation().transpose() * apart.normalized();
  int votes = 0;
  Surface surface;
  const auto finish = [&] {
    votes += surface.Vote(clearly_m);
    surface = {};
  };
  for (const SurfacePoint& point : points_robot) {
    if (point.smooth() && std::abs(point.normal.dot(along)) < kFacing) continue;
    if (surface.points > 0 && (point.p - surface.end).norm() > kGapM) finish();
    if (surface.points == 0) surface.begin = point.p;
    surface.end = point.p;
    ++surface.points;
    surface.gain_m += DistanceAt(point, reference, T_ref_first) - DistanceAt(point, reference, T_ref_second);
  }
  finish();
  return votes;
}

}  // namespace cairn::slam
