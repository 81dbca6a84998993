// Compares the surroundings of a recent keyframe with those of an old one, in parts: a comparison takes some ten
// milliseconds, which no single scan should wait for. The work is counted in operations and not in time, so that the
// same input gives the same result. It reads only keyframes up to the recent one, which do not change.
// Frames: T_old_recent. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/region.h"
#include "server/slam/loops/unique_pose.h"

namespace cairn::slam {

// Smallest share of the recent surfaces that must be found again. Half or twice of it changes the results on the first
// 4500 scans of mit-killian no more than another seed (study `sensitivity`).
inline constexpr double kMinExplained = 0.5;

class LoopComparison {
 public:
  // `align` is used for the exact pose, from where the search has found one.
  LoopComparison(const LoopOptions& options, const PointToLineOptions& align, const LoopCandidate& candidate,
                 std::size_t recent)
      : options_(options), align_(align), candidate_(candidate), recent_(recent) {}

  // Goes on by about `work` units, each of which takes a nanosecond or two, and returns how many were done. The largest
  // part that is not divided takes some millions. Calls with the same sum of work end at the same place.
  std::int64_t GoOn(const Trail& trail, std::int64_t work);
  [[nodiscard]] bool done() const { return step_ == Step::kDone; }
  // Nothing if the surroundings differ. REQUIRES: done().
  [[nodiscard]] const std::optional<LoopClosure>& closure() const { return closure_; }

 private:
  enum class Step : std::uint8_t {
    kRecentSurfaces,
    kOldSurfaces,
    kRaster,
    kSearch,
    kAlign,
    kOldFree,
    kRecentFree,
    kDone
  };

  // Each does one step, or a part of it, and returns the work done.
  std::int64_t DoStep(const Trail& trail, std::int64_t work);
  std::int64_t CollectRecent(const Trail& trail);
  std::int64_t CollectOld(const Trail& trail);
  std::int64_t MakeRaster();
  std::int64_t Search(std::int64_t work);
  std::int64_t Align();
  std::int64_t CompareWithOldFree(const Trail& trail);
  std::int64_t CompareWithRecentFree(const Trail& trail);

  const LoopOptions& options_;
  const PointToLineOptions& align_;
  const LoopCandidate candidate_;
  const std::size_t recent_;
  Step step_ = Step::kRecentSurfaces;
  Stretch recent_stretch_, old_stretch_;
  std::vector<SurfacePoint> recent_surfaces_, old_surfaces_;
  std::unique_ptr<LikelihoodPyramid> raster_;
  std::unique_ptr<UniquePoseSearch> search_;
  std::unique_ptr<PointIndex> old_index_;
  Pose2 T_old_recent_;
  std::optional<LoopClosure> closure_;
};

}  // namespace cairn::slam
