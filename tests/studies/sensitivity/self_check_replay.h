// The results of the self-check along given paths. This shows the influence of its constants without running the
// estimator again for each. In the mapper a path may be corrected on the way; here it stays the same throughout.
// Deterministic.
#pragma once

#include <vector>

#include "server/slam/mapper_options.h"
#include "server/slam/scan/surface_points.h"
#include "server/slam/trail/trail.h"
#include "tests/studies/sensitivity/cases.h"

namespace cairn::studies {

class SelfCheckReplay {
 public:
  // Drives the case twice: with the default filter, whose smoothed path counts as right, and with the filter
  // `none`, whose path is wrong where the front-end drifted.
  explicit SelfCheckReplay(const Case& one);

  // "false alarms": share of the keyframes along the right path that it calls contradicted; "noticed": along
  // the other.
  [[nodiscard]] Figures Measure(const slam::SelfCheckOptions& options) const;

 private:
  struct Path {
    std::vector<slam::Keyframe> keyframes;
    std::vector<std::vector<slam::SurfacePoint>> points_robot;  // One set per keyframe.
    std::vector<Pose2> poses;                                   // T_map_robot.
  };
  static Path PathOf(const std::vector<slam::Keyframe>& keyframes, std::vector<Pose2> poses,
                     const slam::SurfaceOptions& surface);
  static double ContradictedShare(const Path& path, const slam::SelfCheckOptions& options);

  Path right_, drifting_;
};

}  // namespace cairn::studies
