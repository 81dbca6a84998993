// Compares the surfaces seen along two stretches of way, which may belong to different paths, and measures how one lies
// relative to the other. It finds nothing if another pose fits nearly as well, if too little of the second stretch is
// explained, or if surfaces lie where beams passed. Frames: the robot frames of the stretches' anchors. Stateless,
// thread-safe, deterministic.
// Source: branch and bound of Hess et al., ICRA 2016; the comparison of free space as in Lu and Milios 1997.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/region.h"
#include "server/slam/loops/region_search.h"
#include "server/slam/loops/unique_pose.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// Half width of the search window for a way of zero.
inline constexpr double kLeastDoubtM = 1.5;
// How far around a guess a place is searched for that lies `way_m` away along the known relations.
[[nodiscard]] SearchWindow WindowAround(const Pose2& T_ref_curr_guess, double way_m, const LoopOptions& options);

// The comparison in parts: it takes some ten milliseconds, which no single scan should wait for. The work is counted in
// operations and not in time, so that the same input gives the same result. It reads keyframes of the two stretches
// only, which must not change meanwhile. Not thread-safe.
class StretchMatch {
 public:
  // `options` and `align` must outlive it.
  StretchMatch(const Stretch& ref, const Stretch& curr, const SearchWindow& window, const LoopOptions& options,
               const PointToLineOptions& align);

  // Goes on by about `work` units, each of which takes a nanosecond or two, and returns how many were done. The largest
  // part that is not divided takes some millions. Calls with the same sum of work end at the same place.
  std::int64_t GoOn(const Trail& trail_ref, const Trail& trail_curr, std::int64_t work);
  [[nodiscard]] bool done() const { return part_ == Part::kDone; }
  // What MatchStretches returns. REQUIRES: done().
  [[nodiscard]] const std::optional<Pose2>& T_ref_curr() const { return found_; }

 private:
  enum class Part : std::uint8_t { kSurfaces, kPyramid, kSearch, kAlign, kRefFree, kCurrFree, kDone };

  // Each does one part, or what `work` allows of it, and returns the work done.
  std::int64_t DoPart(const Trail& trail_ref, const Trail& trail_curr, std::int64_t work);
  std::int64_t CollectSurfaces(const Trail& trail_ref, const Trail& trail_curr);
  std::int64_t MakePyramid();
  std::int64_t Search(std::int64_t work);
  std::int64_t Align();
  std::int64_t CompareWithRef(const Trail& trail_ref);
  std::int64_t CompareWithCurr(const Trail& trail_curr);

  const LoopOptions& options_;
  const PointToLineOptions& align_;
  const Stretch ref_, curr_;
  const SearchWindow window_;
  Part part_ = Part::kSurfaces;
  std::vector<SurfacePoint> surfaces_ref_, surfaces_curr_;
  std::unique_ptr<LikelihoodPyramid> pyramid_;
  std::unique_ptr<UniquePoseSearch> search_;
  std::unique_ptr<PointIndex> index_ref_;
  Pose2 T_ref_curr_;
  std::optional<Pose2> found_;
};

// T_ref_curr, searched in `window`. The thresholds are `options.max_rival` and `options.max_conflict`.
[[nodiscard]] std::optional<Pose2> MatchStretches(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr,
                                                  const Stretch& curr, const SearchWindow& window,
                                                  const LoopOptions& options, const PointToLineOptions& align);

}  // namespace cairn::slam
