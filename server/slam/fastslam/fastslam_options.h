// Options of the particle filters over landmarks.
#pragma once

#include "common/options/option_visitor.h"

namespace cairn::slam {

struct FastSlamOptions {
  double sample_distance_m = 1.0;
  double resample_below = 0.5;
  // Only the study of sensitivity sets these.
  double agreement_m = 0.5;    // Particles this near to the best one take part in the reported pose.
  double loop_sigma_m = 0.05;  // Standard deviation of the pose after a large loop, which does not make it exact.
  double loop_sigma_rad = 0.01;
};
void Visit(OptionVisitor& visitor, FastSlamOptions& options);

}  // namespace cairn::slam
