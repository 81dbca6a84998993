#include "server/slam/loops/loop_comparison.h"

#include <algorithm>
#include <utility>

#include "common/geometry/transform2.h"
#include "server/slam/matching/point_index.h"

namespace cairn::slam {
namespace {

constexpr int kLevels = 5;
// Half or twice of this changes the results on the first 4500 scans of mit-killian no more than another seed
// (study `sensitivity`).
constexpr double kNearShare = 2.0;  // Tolerance for a surface, in inlier distances of the alignment.

// Work of a step for each point, cell or keyframe, in look-ups of the search.
constexpr std::int64_t kPerCollectedPoint = 30, kPerComparedPoint = 100, kPerDrawnKeyframe = 20'000;

// Numbers of `surfaces`, transformed by `T`, that agree with the other side and that contradict it.
struct Agreement {
  int explained = 0;
  int conflicts = 0;
  [[nodiscard]] double conflict() const {
    return conflicts / std::max(1.0, static_cast<double>(explained + conflicts));
  }
};

Agreement AgreementOf(const std::vector<SurfacePoint>& surfaces, const Pose2& T, const PointIndex& other,
                      const FreeSpace& other_free, double near_m) {
  Agreement agreement;
  const Transform2 to_other(T);
  for (const SurfacePoint& surface : surfaces) {
    const Eigen::Vector2d p = to_other * surface.p;
    if (other.Nearest(p, near_m) != nullptr) {
      ++agreement.explained;
    } else if (other_free.Contradicts(p)) {
      ++agreement.conflicts;
    }
  }
  return agreement;
}

std::int64_t PointsOf(const Trail& trail, const Stretch& stretch) {
  std::size_t points = 0;
  for (std::size_t k = stretch.first; k <= stretch.last; ++k) points += trail.points(k).size();
  return static_cast<std::int64_t>(points);
}

std::int64_t KeyframesOf(const Stretch& stretch) {
  return static_cast<std::int64_t>(stretch.last - stretch.first + 1);
}

}  // namespace

std::int64_t LoopComparison::GoOn(const Trail& trail, std::int64_t work) {
  std::int64_t worked = 0;
  while (!done() && worked < work) worked += DoStep(trail, work - worked);
  return worked;
}

std::int64_t LoopComparison::DoStep(const Trail& trail, std::int64_t work) {
  switch (step_) {
    case Step::kRecentSurfaces:
      return CollectRecent(trail);
    case Step::kOldSurfaces:
      return CollectOld(trail);
    case Step::kRaster:
      return MakeRaster();
    case Step::kSearch:
      return Search(work);
    case Step::kAlign:
      return Align();
    case Step::kOldFree:
      return CompareWithOldFree(trail);
    case Step::kRecentFree:
      return CompareWithRecentFree(trail);
    case Step::kDone:
      break;
  }
  return 0;
}

std::int64_t LoopComparison::CollectRecent(const Trail& trail) {
  const std::span<const KeyframeShape> shapes = trail.shapes().first(recent_ + 1);
  recent_stretch_ = StretchAround(shapes, recent_, kStretchM);
  step_ = Step::kDone;
  if (candidate_.old >= recent_stretch_.first) return 1;  // This is the present place, not an old one.
  old_stretch_ = StretchAround(shapes.first(recent_stretch_.first), candidate_.old, kStretchM);
  recent_surfaces_ = SurfacesOf(trail, recent_stretch_, 2.0 * kSearchCellM);
  step_ = Step::kOldSurfaces;
  return kPerCollectedPoint * PointsOf(trail, recent_stretch_);
}

std::int64_t LoopComparison::CollectOld(const Trail& trail) {
  old_surfaces_ = SurfacesOf(trail, old_stretch_, 0.5 * kSearchCellM);
  const bool enough = std::min(recent_surfaces_.size(), old_surfaces_.size()) >= kMinSurfaces;
  step_ = enough ? Step::kRaster : Step::kDone;
  return kPerCollectedPoint * PointsOf(trail, old_stretch_);
}

std::int64_t LoopComparison::MakeRaster() {
  raster_ = std::make_unique<LikelihoodPyramid>(old_surfaces_, kSearchCellM, kLikelihoodReachM, kLevels);
  search_ = std::make_unique<UniquePoseSearch>(recent_surfaces_, *raster_, candidate_.window, options_.max_rival);
  step_ = Step::kSearch;
  return kPerComparedPoint * static_cast<std::int64_t>(old_surfaces_.size());
}

std::int64_t LoopComparison::Search(std::int64_t work) {
  const std::int64_t done = search_->GoOn(work);
  if (!search_->done()) return done;
  step_ = search_->pose() ? Step::kAlign : Step::kDone;
  if (search_->pose()) T_old_recent_ = *search_->pose();
  search_.reset();
  raster_.reset();
  return done;
}

std::int64_t LoopComparison::Align() {
  old_index_ = std::make_unique<PointIndex>(old_surfaces_);
  const MatchResult aligned = AlignPointsToSurfaces(recent_surfaces_, *old_index_,
                                                    {T_old_recent_, T_old_recent_, UniquePoseCovariance()}, align_);
  T_old_recent_ = aligned.T_ref_curr;
  step_ = aligned.converged && !aligned.degenerate ? Step::kOldFree : Step::kDone;
  return kPerComparedPoint * static_cast<std::int64_t>(old_surfaces_.size() + 10 * recent_surfaces_.size());
}

std::int64_t LoopComparison::CompareWithOldFree(const Trail& trail) {
  const FreeSpace old_free(trail, old_stretch_, options_.free_cell_m);
  const Agreement ours =
      AgreementOf(recent_surfaces_, T_old_recent_, *old_index_, old_free, kNearShare * align_.inlier_distance_m);
  const bool same = ours.explained >= kMinExplained * static_cast<double>(recent_surfaces_.size()) &&
                    ours.conflict() <= options_.max_conflict;
  step_ = same ? Step::kRecentFree : Step::kDone;
  return kPerDrawnKeyframe * KeyframesOf(old_stretch_);
}

std::int64_t LoopComparison::CompareWithRecentFree(const Trail& trail) {
  const FreeSpace recent_free(trail, recent_stretch_, options_.free_cell_m);
  const PointIndex recent_index(recent_surfaces_);
  const Agreement theirs = AgreementOf(old_surfaces_, T_old_recent_.Inverse(), recent_index, recent_free,
                                       kNearShare * align_.inlier_distance_m);
  if (theirs.conflict() <= options_.max_conflict)
    closure_ = LoopClosure{candidate_.old, recent_, T_old_recent_, PoseCovariance(options_.sigma_m, kFoundSigmaRad)};
  step_ = Step::kDone;
  return kPerDrawnKeyframe * KeyframesOf(recent_stretch_);
}

}  // namespace cairn::slam
