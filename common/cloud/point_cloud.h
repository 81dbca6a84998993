// Points in space: what scans of a tilting scanner and the robot's poses in the plane add up to. Frame: `map`, metres,
// z up from the floor the robot drives on. Plain value; float, as files hold it (1 mm at 10 km).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace cairn {

using PointCloud = std::vector<Eigen::Vector3f>;

}  // namespace cairn
