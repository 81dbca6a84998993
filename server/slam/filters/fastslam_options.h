// Options of the particle filters over landmarks.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"
#include "server/slam/motion/motion_sampling.h"

namespace cairn::slam {

struct FastSlamOptions {
  double sample_distance_m = 1.0;  // Travelled before uncertainty is sampled without an observation (2.0 only).
  double resample_below = 0.5;     // Effective sample size over particles.
  double agreement_m = 0.5;        // Particles this near the best one take part in the reported pose.
  MotionSampling motion;           // How FastSLAM 1.0 samples a step.
};
void Visit(OptionVisitor& visitor, FastSlamOptions& options);

}  // namespace cairn::slam
