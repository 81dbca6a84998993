// One scan as rays in the robot frame, prepared once for all particles: beams without information are left
// out, long ones are cut, and if there are too many, they are thinned evenly. A tilted scan plane is
// projected on the ground as in scan/beam_points.h. Immutable. Precondition: the scan passed ValidateScan.
// Metres.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "common/sensor/scan.h"
#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

struct LaserRay {
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();  // Unit vector in the robot frame.
  double length_m = 0.0;
  bool hit = false;  // False: the ray passed at least this far, and the space beyond is unknown.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.direction, self.length_m, self.hit);
    archive.Require(self.direction.cwiseAbs().maxCoeff() <= 2.0 && 0.0 <= self.length_m && self.length_m <= 1e4,
                    "a ray");
  }
};

struct LaserRays {
  Eigen::Vector2d origin_robot = Eigen::Vector2d::Zero();
  std::vector<LaserRay> rays;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.origin_robot, self.rays);
  }
};

[[nodiscard]] LaserRays RaysOf(const Scan& scan, const OpacityOptions& options);

// The cells that a ray crosses, one by one, with the exact length of the ray in each. Coordinates and lengths
// in cells. Source: Amanatides, Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.

// The state of a walk: next_* is the distance along the ray to the next column or row of cells.
struct RayWalk {
  // `direction` has length 1.
  RayWalk(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction)
      : x(static_cast<int>(std::floor(origin.x()))), y(static_cast<int>(std::floor(origin.y()))) {
    Axis(origin.x(), direction.x(), x, step_x, per_x, next_x);
    Axis(origin.y(), direction.y(), y, step_y, per_y, next_y);
  }

  int x, y;
  int step_x = 1, step_y = 1;
  double per_x = 0.0, per_y = 0.0;  // Distance along the ray per column and row.
  double next_x = 0.0, next_y = 0.0;

 private:
  static void Axis(double origin, double direction, int cell, int& step, double& per, double& next) {
    // A ray along the other axis never leaves its column: one step along this axis is longer than any ray.
    per = std::abs(direction) > 1e-9 ? 1.0 / std::abs(direction) : 1e9;
    step = direction < -1e-9 ? -1 : 1;
    next = (step > 0 ? cell + 1 - origin : origin - cell) * per;
  }
};

// Calls visit(x, y, from, to) for every cell (x, y); `from` and `to` are the distances along the ray at which
// it enters and leaves the cell. REQUIRES: 0 <= length < 1e8.
template <typename Visit>
void WalkRay(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, double length, Visit&& visit) {
  RayWalk walk(origin, direction);
  double from = 0.0;
  for (;;) {
    const bool across = walk.next_x < walk.next_y;
    const double to = across ? walk.next_x : walk.next_y;
    if (!(to < length)) {
      visit(walk.x, walk.y, from, length);
      return;
    }
    visit(walk.x, walk.y, from, to);
    from = to;
    if (across) {
      walk.x += walk.step_x;
      walk.next_x += walk.per_x;
    } else {
      walk.y += walk.step_y;
      walk.next_y += walk.per_y;
    }
  }
}

}  // namespace cairn::slam
