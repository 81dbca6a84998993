#include "server/slam/dpslam/opacity.h"

#include <cmath>

#include "common/geometry/angle.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, OpacityOptions& options) {
  visitor.Real("resolution_m", options.resolution_m, "m", 0.02, 1.0, "Side of a cell in the maps of the particles.");
  visitor.Real("max_ray_m", options.max_ray_m, "m", 1.0, 50.0,
               "Rays are used up to this length. A longer one only says that the space up to here is free.");
  visitor.Real("no_return_m", options.no_return_m, "m", 0.0, 50.0,
               "Length up to which a beam without an echo says that space is free. 0 ignores such beams.");
  visitor.Real("prior_stops", options.prior_stops, "1", 0.0001, 10.0,
               "Number of rays that count as stopped in a cell before it is seen. With a larger value unknown space "
               "stops more rays.");
  visitor.Real(
      "prior_distance_m", options.prior_distance_m, "m", 0.001, 10.0,
      "Length of rays that counts as passed in a cell before it is seen. With a larger value cells learn more slowly.");
  visitor.Integer("max_rays", options.max_rays, "1", 1, 8192, "Most rays of a scan that are used, evenly chosen.");
  visitor.Require(options.no_return_m <= options.max_ray_m, "no_return_m", "must not exceed", "max_ray_m");
}

StopRate::StopRate(const OpacityOptions& options)
    : prior_stops(static_cast<float>(options.prior_stops)),
      prior_cells(static_cast<float>(options.prior_distance_m / options.resolution_m)) {}

double StopProbability(double length_m, double opacity_m) {
  return -std::expm1(-length_m / opacity_m);
}

}  // namespace cairn::slam
