#include "server/slam/loops/stretch_match.h"

#include <algorithm>
#include <vector>

#include "common/geometry/transform2.h"
#include "server/slam/loops/unique_pose.h"
#include "server/slam/matching/point_index.h"

namespace cairn::slam {
namespace {

// Half or twice of each of these changes the results on the first 4500 scans of mit-killian no more than another seed
// (study `sensitivity`).
constexpr int kLevels = 5;
constexpr double kDoubtRad = 0.1;      // Turn searched to either side for a way of zero.
constexpr double kMaxDoubtRad = 0.6;   // Largest turn searched to either side.
constexpr double kMinExplained = 0.5;  // Smallest share of the second stretch that must be found again.
constexpr double kNearShare = 2.0;     // Tolerance for a surface, in inlier distances of the alignment.

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
  PointIndex::Found neighbour;
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

}  // namespace

SearchWindow WindowAround(const Pose2& T_ref_curr_guess, double way_m, const LoopOptions& options) {
  return {T_ref_curr_guess, std::min(options.max_doubt_m, kLeastDoubtM + options.doubt_per_m * way_m),
          std::min(kMaxDoubtRad, kDoubtRad + options.doubt_rad_per_m * way_m)};
}

StretchMatch::StretchMatch(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr, const Stretch& curr,
                           const SearchWindow& window, double max_rival)
    : ref_(ref),
      curr_(curr),
      recent_(SurfacesOf(trail_curr, curr, 2.0 * kSearchCellM)),
      before_(SurfacesOf(trail_ref, ref, 0.5 * kSearchCellM)) {
  if (std::min(recent_.size(), before_.size()) < kMinSurfaces) return;
  pyramid_.emplace(before_, kSearchCellM, kLikelihoodReachM, kLevels);
  search_.emplace(recent_, *pyramid_, window, max_rival);
  step_ = Step::kSearch;
}

bool StretchMatch::GoOn(const Trail& trail_ref, const Trail& trail_curr, int blocks, const LoopOptions& options,
                        const PointToLineOptions& align) {
  step_ = Next(trail_ref, trail_curr, blocks, options, align);
  return step_ == Step::kEnded;
}

StretchMatch::Step StretchMatch::Next(const Trail& trail_ref, const Trail& trail_curr, int blocks,
                                      const LoopOptions& options, const PointToLineOptions& align) {
  const double near_m = kNearShare * align.inlier_distance_m;
  switch (step_) {
    case Step::kSearch:
      // For the best pose and for its rivals, which often takes few blocks each.
      if (!search_->GoOn(blocks / 2) && !search_->GoOn(blocks / 2)) return Step::kSearch;
      return search_->found() ? Step::kAlign : Step::kEnded;
    case Step::kAlign:
      return Align(align) && OursAgree(trail_ref, options, near_m) ? Step::kTheirs : Step::kEnded;
    case Step::kTheirs:
      if (TheirsAgree(trail_curr, options, near_m)) found_ = aligned_;
      return Step::kEnded;
    case Step::kEnded:
      break;
  }
  return Step::kEnded;
}

bool StretchMatch::Align(const PointToLineOptions& align) {
  before_index_.emplace(before_);
  PointToLineOptions explaining = align;
  explaining.min_score = kMinExplained;
  const Pose2& unique = *search_->found();
  const MatchResult aligned =
      AlignPointsToSurfaces(recent_, *before_index_, {unique, unique, UniquePoseCovariance()}, explaining);
  aligned_ = aligned.T_ref_curr;
  return aligned.converged && !aligned.degenerate;
}

bool StretchMatch::OursAgree(const Trail& trail_ref, const LoopOptions& options, double near_m) const {
  const FreeSpace before_free(trail_ref, ref_, options.free_cell_m);
  const Agreement ours = AgreementOf(recent_, aligned_, *before_index_, before_free, near_m);
  return ours.explained >= kMinExplained * static_cast<double>(recent_.size()) &&
         ours.conflict() <= options.max_conflict;
}

bool StretchMatch::TheirsAgree(const Trail& trail_curr, const LoopOptions& options, double near_m) const {
  const PointIndex recent_index(recent_);
  const FreeSpace recent_free(trail_curr, curr_, options.free_cell_m);
  const Agreement theirs = AgreementOf(before_, aligned_.Inverse(), recent_index, recent_free, near_m);
  return theirs.conflict() <= options.max_conflict;
}

std::optional<Pose2> MatchStretches(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr,
                                    const Stretch& curr, const SearchWindow& window, const LoopOptions& options,
                                    const PointToLineOptions& align) {
  StretchMatch match(trail_ref, ref, trail_curr, curr, window, options.max_rival);
  while (!match.GoOn(trail_ref, trail_curr, kMaxBlocks, options, align)) {
  }
  return match.found();
}

}  // namespace cairn::slam
