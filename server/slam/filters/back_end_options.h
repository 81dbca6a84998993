// Options that all filters of the mapper share: the drift of the motion that they receive, landmarks, and
// when a filter counts as diverged.
#pragma once

#include <cstdint>

#include "server/slam/landmarks/landmark_options.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

struct BackEndOptions {
  MotionNoise drift{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005};
  LandmarkOptions landmarks;
  double max_nis = 16.0;
  std::int64_t diverged_after = 10;
};

}  // namespace cairn::slam
