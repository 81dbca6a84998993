// How FastSLAM 1.0 samples a step: `input` selects the part of the measured step that the motion model uses,
// and `draw` draws a pose with the noise of the model. The motion model is provided by the code that makes
// the filter. FastSLAM 2.0 needs none.
#pragma once

#include <functional>

#include "server/slam/motion/step_motion.h"
#include "server/slam/random/draws.h"

namespace cairn::slam {

struct MotionSampler {
  std::function<StepMotion(const StepMotion& measured)> input;
  // `step` is a result of `input`. Its covariance is not part of the model's noise.
  std::function<Pose2(const Pose2& T_map_robot, const StepMotion& step, Rng& rng)> draw;
};

}  // namespace cairn::slam
