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

std::optional<Pose2> MatchStretches(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr,
                                    const Stretch& curr, const SearchWindow& window, const LoopOptions& options,
                                    const PointToLineOptions& align) {
  const std::vector<SurfacePoint> recent = SurfacesOf(trail_curr, curr, 2.0 * kSearchCellM);
  const std::vector<SurfacePoint> before = SurfacesOf(trail_ref, ref, 0.5 * kSearchCellM);
  if (std::min(recent.size(), before.size()) < kMinSurfaces) return std::nullopt;

  const LikelihoodPyramid pyramid(before, kSearchCellM, kLikelihoodReachM, kLevels);
  const auto unique = FindUniquePose(recent, pyramid, window, options.max_rival);
  if (!unique) return std::nullopt;
  const PointIndex before_index(before);
  PointToLineOptions explaining = align;
  explaining.min_score = kMinExplained;
  const MatchResult aligned =
      AlignPointsToSurfaces(recent, before_index, {*unique, *unique, UniquePoseCovariance()}, explaining);
  if (!aligned.converged || aligned.degenerate) return std::nullopt;
  const double near_m = kNearShare * align.inlier_distance_m;
  const FreeSpace before_free(trail_ref, ref, options.free_cell_m);
  const Agreement ours = AgreementOf(recent, aligned.T_ref_curr, before_index, before_free, near_m);
  if (ours.explained < kMinExplained * static_cast<double>(recent.size()) || ours.conflict() > options.max_conflict)
    return std::nullopt;
  const PointIndex recent_index(recent);
  const FreeSpace recent_free(trail_curr, curr, options.free_cell_m);
  const Agreement theirs = AgreementOf(before, aligned.T_ref_curr.Inverse(), recent_index, recent_free, near_m);
  if (theirs.conflict() > options.max_conflict) return std::nullopt;
  return aligned.T_ref_curr;
}

}  // namespace cairn::slam
