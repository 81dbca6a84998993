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

UniquePoseSearch::UniquePoseSearch(std::span<const SurfacePoint> surfaces_curr, const LikelihoodPyramid& pyramid_ref,
                                   const SearchWindow& window, double max_rival)
    : sample_(SampleOf(surfaces_curr)),
      pyramid_(&pyramid_ref),
      max_rival_(max_rival),
      search_(sample_, pyramid_ref, window) {
  search_.Begin(kMinLikelihood);
}

void UniquePoseSearch::LookFirstIn(const SearchWindow& likely) {
  const auto peak = FindBestPose(sample_, *pyramid_, likely, kMinLikelihood);
  if (!peak || !peak->complete) return;
  // The best pose may be outside if this one is at the edge.
  const Pose2 off = Between(likely.T_ref_curr_centre, peak->T_ref_curr);
  if (off.translation().norm() > 0.5 * likely.reach_m || std::abs(off.theta) > 0.5 * likely.reach_rad) return;
  LookForRivals(*peak, Step::kRivalOfLikely);
}

void UniquePoseSearch::LookForRivals(const RegionPeak& of, Step step) {
  best_ = of.T_ref_curr;
  const Exclusion own = ApartFrom(of.T_ref_curr);
  search_.Begin(max_rival_ * of.score, std::span(&own, 1), true);
  step_ = step;
}

bool UniquePoseSearch::GoOn(int blocks) {
  if (step_ == Step::kEnded) return true;
  if (!search_.GoOn(blocks)) return false;
  const auto peak = search_.peak();
  if (step_ == Step::kRivalOfLikely && peak) {  // The best pose may be another one.
    search_.Begin(kMinLikelihood);
    best_.reset();
    step_ = Step::kBest;
    return false;
  }
  if (step_ == Step::kBest && peak && peak->complete) {
    LookForRivals(*peak, Step::kRival);
    return false;
  }
  if (step_ != Step::kBest && !peak) found_ = best_;
  step_ = Step::kEnded;
  return true;
}

std::optional<Pose2> FindUniquePose(std::span<const SurfacePoint> surfaces_curr, const LikelihoodPyramid& pyramid_ref,
                                    const SearchWindow& window, double max_rival) {
  UniquePoseSearch search(surfaces_curr, pyramid_ref, window, max_rival);
  while (!search.GoOn(kMaxBlocks)) {
  }
  return search.found();
}

Eigen::Matrix3d UniquePoseCovariance() {
  return Eigen::Vector3d(0.25, 0.25, 0.01).asDiagonal();
}

bool ConfirmEachOther(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kAgreeM && std::abs(AngleDiff(a.theta, b.theta)) < kAgreeRad;
}

}  // namespace cairn::slam
