// How badly scans and a map disagree: the mean over all hit beams of the squared distance from where the beam ended, at
// the pose given, to the nearest occupied cell of the grid; distances count as at most kMaxDistanceM, so that people
// and opened doors do not rule the figure. m^2. What smoothing compares paths by. A plain value; sums of several add
// up.
#pragma once

#include <cstdint>

#include "common/sensor/scan.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::slam {

class Disagreement {
 public:
  static constexpr double kMaxDistanceM = 0.3;

  void Add(const Scan& scan, const Pose2& T_map_robot, const OccupancyGrid& grid);
  void Add(const Disagreement& other);
  [[nodiscard]] double mean_m2() const { return beams_ > 0 ? sum_m2_ / static_cast<double>(beams_) : 0.0; }

 private:
  double sum_m2_ = 0.0;
  std::int64_t beams_ = 0;
};

}  // namespace cairn::slam
