#include "server/slam/loops/stretch_match.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/geometry/transform2.h"

namespace cairn::slam {
namespace {

// Half or twice of each of these changes the results on the first 4500 scans of mit-killian no more than another seed
// (study `sensitivity`).
constexpr int kLevels = 5;
constexpr double kDoubtRad = 0.1;      // Turn searched to either side for a way of zero.
constexpr double kMaxDoubtRad = 0.6;   // Largest turn searched to either side.
constexpr double kMinExplained = 0.5;  // Smallest share of the second stretch that must be found again.
constexpr double kNearShare = 2.0;     // Tolerance for a surface, in inlier distances of the alignment.

// Work of a part for each point or keyframe, in look-ups of the search.
constexpr std::int64_t kPerCollectedPoint = 30, kPerComparedPoint = 100, kPerDrawnKeyframe = 5'000;

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
  std::int32_t neighbour = PointIndex::kNone;
  for (const SurfacePoint& surface : surfaces) {
    const Eigen::Vector2d p = to_other * surface.p;
    if (other.Nearest(p, near_m, neighbour) != nullptr) {
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

SearchWindow WindowAround(const Pose2& T_ref_curr_guess, double way_m, const LoopOptions& options) {
  return {T_ref_curr_guess, std::min(options.max_doubt_m, kLeastDoubtM + options.doubt_per_m * way_m),
          std::min(kMaxDoubtRad, kDoubtRad + options.doubt_rad_per_m * way_m)};
}

StretchMatch::StretchMatch(const Stretch& ref, const Stretch& curr, const SearchWindow& window,
                           const LoopOptions& options, const PointToLineOptions& align)
    : options_(options), align_(align), ref_(ref), curr_(curr), window_(window) {}

std::int64_t StretchMatch::GoOn(const Trail& trail_ref, const Trail& trail_curr, std::int64_t work) {
  std::int64_t worked = 0;
  while (!done() && worked < work) worked += DoPart(trail_ref, trail_curr, work - worked);
  return worked;
}

std::int64_t StretchMatch::DoPart(const Trail& trail_ref, const Trail& trail_curr, std::int64_t work) {
  switch (part_) {
    case Part::kSurfaces:
      return CollectSurfaces(trail_ref, trail_curr);
    case Part::kPyramid:
      return MakePyramid();
    case Part::kSearch:
      return Search(work);
    case Part::kAlign:
      return Align();
    case Part::kRefFree:
      return CompareWithRef(trail_ref);
    case Part::kCurrFree:
      return CompareWithCurr(trail_curr);
    case Part::kDone:
      break;
  }
  return 0;
}

std::int64_t StretchMatch::CollectSurfaces(const Trail& trail_ref, const Trail& trail_curr) {
  surfaces_curr_ = SurfacesOf(trail_curr, curr_, 2.0 * kSearchCellM);
  surfaces_ref_ = SurfacesOf(trail_ref, ref_, 0.5 * kSearchCellM);
  part_ = std::min(surfaces_curr_.size(), surfaces_ref_.size()) < kMinSurfaces ? Part::kDone : Part::kPyramid;
  return kPerCollectedPoint * (PointsOf(trail_curr, curr_) + PointsOf(trail_ref, ref_));
}

std::int64_t StretchMatch::MakePyramid() {
  pyramid_ = std::make_unique<LikelihoodPyramid>(surfaces_ref_, kSearchCellM, kLikelihoodReachM, kLevels);
  search_ = std::make_unique<UniquePoseSearch>(surfaces_curr_, *pyramid_, window_, options_.max_rival);
  part_ = Part::kSearch;
  return kPerComparedPoint * static_cast<std::int64_t>(surfaces_ref_.size());
}

std::int64_t StretchMatch::Search(std::int64_t work) {
  const std::int64_t worked = search_->GoOn(work);
  if (!search_->done()) return worked;
  part_ = search_->pose() ? Part::kAlign : Part::kDone;
  T_ref_curr_ = search_->pose().value_or(Pose2{});
  search_.reset();
  pyramid_.reset();
  return worked;
}

std::int64_t StretchMatch::Align() {
  index_ref_ = std::make_unique<PointIndex>(surfaces_ref_);
  PointToLineOptions explaining = align_;
  explaining.min_score = kMinExplained;
  const MatchResult aligned = AlignPointsToSurfaces(surfaces_curr_, *index_ref_,
                                                    {T_ref_curr_, T_ref_curr_, UniquePoseCovariance()}, explaining);
  T_ref_curr_ = aligned.T_ref_curr;
  part_ = aligned.converged && !aligned.degenerate ? Part::kRefFree : Part::kDone;
  return kPerComparedPoint * static_cast<std::int64_t>(surfaces_ref_.size() + 10 * surfaces_curr_.size());
}

std::int64_t StretchMatch::CompareWithRef(const Trail& trail_ref) {
  const FreeSpace free_ref(trail_ref, ref_, options_.free_cell_m);
  const Agreement ours =
      AgreementOf(surfaces_curr_, T_ref_curr_, *index_ref_, free_ref, kNearShare * align_.inlier_distance_m);
  const bool same = ours.explained >= kMinExplained * static_cast<double>(surfaces_curr_.size()) &&
                    ours.conflict() <= options_.max_conflict;
  part_ = same ? Part::kCurrFree : Part::kDone;
  return kPerDrawnKeyframe * KeyframesOf(ref_);
}

std::int64_t StretchMatch::CompareWithCurr(const Trail& trail_curr) {
  const FreeSpace free_curr(trail_curr, curr_, options_.free_cell_m);
  const PointIndex index_curr(surfaces_curr_);
  const Agreement theirs = AgreementOf(surfaces_ref_, T_ref_curr_.Inverse(), index_curr, free_curr,
                                       kNearShare * align_.inlier_distance_m);
  if (theirs.conflict() <= options_.max_conflict) found_ = T_ref_curr_;
  part_ = Part::kDone;
  return kPerDrawnKeyframe * KeyframesOf(curr_);
}

std::optional<Pose2> MatchStretches(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr,
                                    const Stretch& curr, const SearchWindow& window, const LoopOptions& options,
                                    const PointToLineOptions& align) {
  StretchMatch match(ref, curr, window, options, align);
  match.GoOn(trail_ref, trail_curr, std::numeric_limits<std::int64_t>::max());
  return match.T_ref_curr();
}

}  // namespace cairn::slam
