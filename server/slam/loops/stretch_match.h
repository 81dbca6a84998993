// Compares the surfaces seen along two stretches of way, which may belong to different paths, and measures how one lies
// relative to the other. It finds nothing if another pose fits nearly as well, if too little of the second stretch is
// explained, or if surfaces lie where beams passed. Frames: the robot frames of the stretches' anchors. Deterministic;
// the functions are stateless and thread-safe.
// Source: branch and bound of Hess et al., ICRA 2016; the comparison of free space as in Lu and Milios 1997.
#pragma once

#include <cstdint>
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

// T_ref_curr, searched in `window`. The thresholds are `options.max_rival` and `options.max_conflict`.
[[nodiscard]] std::optional<Pose2> MatchStretches(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr,
                                                  const Stretch& curr, const SearchWindow& window,
                                                  const LoopOptions& options, const PointToLineOptions& align);

// The same, done in several parts. What was found depends on the trails, the stretches and the window alone, and how
// many parts it takes on these and `blocks`. Not thread-safe.
class StretchMatch {
 public:
  // Collects the surfaces.
  StretchMatch(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr, const Stretch& curr,
               const SearchWindow& window, double max_rival);
  // Refers to parts of itself.
  StretchMatch(const StretchMatch&) = delete;
  StretchMatch& operator=(const StretchMatch&) = delete;
  ~StretchMatch() = default;
  StretchMatch(StretchMatch&&) = delete;
  StretchMatch& operator=(StretchMatch&&) = delete;

  // Goes on until about so many blocks more are evaluated (PoseSearch), or does what takes about as long. Returns
  // whether it has ended. REQUIRES: the trails of the constructor.
  bool GoOn(const Trail& trail_ref, const Trail& trail_curr, int blocks, const LoopOptions& options,
            const PointToLineOptions& align);
  // T_ref_curr, once it has ended.
  [[nodiscard]] const std::optional<Pose2>& found() const { return found_; }

 private:
  enum class Step : std::uint8_t { kSearch, kAlign, kTheirs, kEnded };
  [[nodiscard]] Step Next(const Trail& trail_ref, const Trail& trail_curr, int blocks, const LoopOptions& options,
                          const PointToLineOptions& align);
  [[nodiscard]] bool Align(const PointToLineOptions& align);
  [[nodiscard]] bool OursAgree(const Trail& trail_ref, const LoopOptions& options, double near_m) const;
  [[nodiscard]] bool TheirsAgree(const Trail& trail_curr, const LoopOptions& options, double near_m) const;

  Stretch ref_;
  Stretch curr_;
  std::vector<SurfacePoint> recent_;
  std::vector<SurfacePoint> before_;
  Step step_ = Step::kEnded;
  std::optional<LikelihoodPyramid> pyramid_;
  std::optional<UniquePoseSearch> search_;  // In the pyramid.
  std::optional<PointIndex> before_index_;
  Pose2 aligned_;
  std::optional<Pose2> found_;
};

}  // namespace cairn::slam
