#include "server/slam/filters/fastslam_options.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, FastSlamOptions& options) {
  visitor.Real("sample_distance_m", options.sample_distance_m, "m", 0.0, 1000.0,
               "Travelled before uncertainty is sampled without an observation (2.0).");
  visitor.Real("resample_below", options.resample_below, "1", 0.0, 1.0,
               "Share of particles that still count below which the set is resampled.");
  visitor.Real("agreement_m", options.agreement_m, "m", 0.0, 100.0,
               "Particles this near the best one take part in the reported pose.");
  visitor.Section("motion", "How 1.0 samples a step.", [&] { Visit(visitor, options.motion); });
}

}  // namespace cairn::slam
