#include "server/slam/recovery/recovery_options.h"

#include "common/geometry/angle.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, RecoveryOptions& options) {
  visitor.Real("cell_scale", options.place.cell_scale, "1", 1.0, 10.0,
               "Size of the cells in which the whole map is searched for the robot, in cells of the search for a loop. "
               "Larger cells take less time for a search and find fewer places.");
  visitor.Real(
      "min_explained", options.place.min_explained, "1", 0.1, 1.0,
      "Share of the surfaces seen last that must lie on surfaces of the map at the place found. A larger value "
      "finds fewer robots again where furniture has moved.");
  visitor.Real("near_m", options.place.near_m, "m", 0.1, 20.0,
               "How far a robot may be from the place where somebody says it is (cairn robot relocalise --here).");
  visitor.Real("near_rad", options.place.near_rad, "rad", 0.05, kPi, "The same for its heading.");
}

}  // namespace cairn::slam
