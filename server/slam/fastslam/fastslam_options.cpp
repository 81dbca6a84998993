#include "server/slam/fastslam/fastslam_options.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, FastSlamOptions& options) {
  visitor.Real("sample_distance_m", options.sample_distance_m, "m", 0.0, 1000.0,
               "FastSLAM 2.0 draws the motion of a particle without an observation after this way.");
  visitor.Real("resample_below", options.resample_below, "1", 0.0, 1.0,
               "The particles are resampled when the effective sample size falls below this share of their number.");
}

}  // namespace cairn::slam
