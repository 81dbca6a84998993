// What all filters behind the mapper share: the drift of the motion they are given, landmarks, and when they own up.
#pragma once

#include <cstdint>

#include "server/slam/filters/landmark_options.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

struct BackEndOptions {
  MotionNoise drift{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005};  // Noise of the matched motion.
  LandmarkOptions landmarks;
  double max_nis = 16.0;             // Squared Mahalanobis distance beyond which an observation adds no more doubt.
  std::int64_t diverged_after = 10;  // Revisits in a row that contradict the belief.
};

}  // namespace cairn::slam
