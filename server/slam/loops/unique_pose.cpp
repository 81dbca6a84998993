#include "server/slam/loops/unique_pose.h"

#include <cmath>

namespace cairn::slam {
namespace {

// Half or twice of each of these, and of kMinLikelihood, changes the results on the first 4500 scans of mit-killian no
// more than another seed (study `sensitivity`).
constexpr std::size_t kMaxSearchPoints = 250;  // Most surface points that are used.
// A pose is a rival of the best one if it is farther away than this, or if its heading differs by more.
constexpr double kRivalBeyondM = 1.0;
constexpr double kRivalBeyondRad = 0.3;
constexpr double kAgreeM = 0.5;     // Largest distance between two poses that agree.
constexpr double kAgreeRad = 0.06;  // Largest turn between them.

}  // namespace

std::vector<Eigen::Vector2d> SampleOf(std::span<const SurfacePoint> surfaces) {
  const std::size_t stride = surfaces.size() / kMaxSearchPoints + 1;
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < surfaces.size(); i += stride) points.push_back(surfaces[i].p);
  return points;
}

Exclusion ApartFrom(const Pose2& T_ref_curr) {
  return {T_ref_curr, kRivalBeyondM, kRivalBeyondRad};
}

std::optional<Pose2> FindUniquePose(std::span<const SurfacePoint> surfaces_curr, const LikelihoodPyramid& pyramid_ref,
                                    const SearchWindow& window, double max_rival) {
  const std::vector<Eigen::Vector2d> sample = SampleOf(surfaces_curr);
  const auto peak = FindBestPose(sample, pyramid_ref, window, kMinLikelihood);
  if (!peak || !peak->complete) return std::nullopt;
  if (FindBestPose(sample, pyramid_ref, window, max_rival * peak->score, ApartFrom(peak->T_ref_curr)))
    return std::nullopt;
  return peak->T_ref_curr;
}

Eigen::Matrix3d UniquePoseCovariance() {
  return Eigen::Vector3d(0.25, 0.25, 0.01).asDiagonal();
}

bool ConfirmEachOther(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kAgreeM && std::abs(AngleDiff(a.theta, b.theta)) < kAgreeRad;
}

}  // namespace cairn::slam
