#include "server/slam/loops/unique_pose.h"

#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

// Half or twice of each of these changes the results on the first 4500 scans of mit-killian no more than another seed
// (study `sensitivity`).
constexpr std::size_t kMaxSearchPoints = 250;  // Most surface points that are used.
constexpr double kMinLikelihood = 0.5;         // Smallest mean likelihood of the surfaces.
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
    : sample_(SampleOf(surfaces_curr)), pyramid_(pyramid_ref), window_(window), max_rival_(max_rival) {
  if (!sample_.empty()) search_.emplace(sample_, pyramid_, window_, kMinLikelihood);
}

std::int64_t UniquePoseSearch::GoOn(std::int64_t work) {
  std::int64_t done = 0;
  while (search_ && done < work) {
    done += search_->GoOn(work - done);
    if (search_->done()) End();
  }
  return done;
}

// What follows when one of the two searches has ended.
void UniquePoseSearch::End() {
  const std::optional<RegionPeak> found = search_->peak();
  search_.reset();
  if (peak_) {
    if (!found) pose_ = peak_->T_ref_curr;
  } else if (found && found->complete) {
    peak_ = found;
    search_.emplace(sample_, pyramid_, window_, max_rival_ * found->score, ApartFrom(found->T_ref_curr));
  }
}

std::optional<Pose2> FindUniquePose(std::span<const SurfacePoint> surfaces_curr, const LikelihoodPyramid& pyramid_ref,
                                    const SearchWindow& window, double max_rival) {
  UniquePoseSearch search(surfaces_curr, pyramid_ref, window, max_rival);
  search.GoOn(std::numeric_limits<std::int64_t>::max());
  return search.pose();
}

Eigen::Matrix3d UniquePoseCovariance() {
  return Eigen::Vector3d(0.25, 0.25, 0.01).asDiagonal();
}

bool ConfirmEachOther(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kAgreeM && std::abs(AngleDiff(a.theta, b.theta)) < kAgreeRad;
}

}  // namespace cairn::slam
