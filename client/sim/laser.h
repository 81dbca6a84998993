// A planar laser scanner in a simulated world: exact ray casts, then noise and dropouts.
// A range is the true distance plus an error of one of three kinds (range_error.h), by default a normal one. A beam
// that hits nothing reads +infinity (ROS REP 117); a dropout reads 0, which carries no information. Beams start at the
// scan's stamp and follow each other within `sweep_s`, while the robot moves. The scan plane may be tilted about the
// laser's y axis, positive downwards, while all beams of a scan share one tilt. Frames: beams in `laser`, mounted at
// T_robot_laser, `height_m` above the floor. Source: thesis C 4.3.2, 4.3.3.
#pragma once

#include <span>

#include "client/sim/random.h"
#include "client/sim/range_error.h"
#include "client/sim/ray_caster.h"
#include "client/sim/scene.h"
#include "common/sensor/scan.h"

namespace cairn::sim {

struct LaserOptions {
  int beams = 360;                            // 1..8192.
  double field_of_view_rad = Radians(270.0);  // Centred on the laser's x axis; a full turn has no beam twice.
  double range_min_m = 0.05;
  double range_max_m = 30.0;  // Farther walls are not seen.
  RangeErrorKind error = RangeErrorKind::kSigma;
  double noise_m = 0.01;       // kSigma: standard deviation at any range...
  double noise_share = 0.001;  // ... and what is added to it per metre of range.
  double bound_m = 0.01;       // kPercent, kStep: see range_error.h.
  double bound_share = 0.01;
  double step_m = 1.0;
  double dropout_share = 0.002;  // Share of all beams, 0..1.
  double sweep_s = 0.0;          // From the first beam to the last; 0: all at once.
  Pose2 T_robot_laser{0.12, 0.0, 0.0};
  double height_m = 0.4;  // Height of the tilt axis above the floor; without effect in a flat world.
};
[[nodiscard]] Result<void> Validate(const LaserOptions& options);
[[nodiscard]] RangeError ErrorOf(const LaserOptions& options);
void SetError(const RangeError& error, LaserOptions* options);

// How a robot moves during a sweep.
struct Twist {
  double speed_m_s = 0.0;
  double turn_rad_s = 0.0;
};

// `T_map_robot` at the first beam. `posts` are obstacles that are not part of the scene. |tilt| < 90 deg.
// The scan has no sequence number yet (0); options must be valid.
[[nodiscard]] Scan MeasureScan(const Scene& scene, std::span<const Post> posts, const Pose2& T_map_robot,
                               const Twist& twist, Stamp stamp, double tilt_rad, const LaserOptions& options,
                               Random& random);

// A level scan in a flat world. `discs` are obstacles that are not part of the caster's walls.
[[nodiscard]] Scan MeasureScan(const RayCaster& walls, std::span<const Disc> discs, const Pose2& T_map_robot,
                               const Twist& twist, Stamp stamp, const LaserOptions& options, Random& random);

}  // namespace cairn::sim
