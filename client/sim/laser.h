// A planar laser scanner in a simulated world: exact ray casts, then noise and dropouts.
// A range is the true distance plus an error of one of three kinds (RangeErrorKind), by default a normal one. A beam
// that hits nothing reads +infinity (ROS REP 117); a dropout reads 0, which carries no information. Beams start at the
// scan's stamp and follow each other within `sweep_s`, while the robot moves. The scan plane may be tilted about the
// laser's y axis, positive downwards, while all beams of a scan share one tilt. Frames: beams in `laser`, mounted at
// T_robot_laser, `height_m` above the floor. Source: thesis C 4.3.2, 4.3.3.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/random.h"
#include "client/sim/ray_caster.h"
#include "client/sim/scene.h"
#include "common/sensor/scan.h"
#include "common/status.h"

namespace cairn::sim {

// The three ways in which makers of laser scanners state a range's random error, and draws from them.
// "+-e" is taken as a bound that no error exceeds, with all errors within it equally likely, because the makers state
// no more than that. Source: thesis C 4.3.3.
enum class RangeErrorKind : std::uint8_t {
  kSigma = 0,  // Normal, standard deviation sigma_m + sigma_share * range.
  kPercent,    // Within +-(bound_m + bound_share * range): a fixed number or a percentage, the other being 0.
  kStep,       // Within +-bound_m up to step_m, within +-bound_share * range beyond.
};
// In the order of the enum: sigma, percent, step.
[[nodiscard]] std::span<const std::string_view> RangeErrorNames();

struct RangeError {
  RangeErrorKind kind = RangeErrorKind::kSigma;
  double sigma_m = 0.01;
  double sigma_share = 0.001;  // Added per metre of range.
  double bound_m = 0.01;
  double bound_share = 0.01;
  double step_m = 1.0;
  double sigma_far_m = 0.0;  // kSigma: beyond step_m this instead of sigma_m; 0: sigma_m everywhere.
  double bias_m = 0.0;       // Every range is wrong by bias_m + bias_share * range. Makers state it as "accuracy".
  double bias_share = 0.0;
  double quantum_m = 0.0;  // Ranges are multiples of this; 0: any range.
};
[[nodiscard]] Result<void> Validate(const RangeError& error);

// The half-width of what a draw may be, or its standard deviation for kSigma; without bias and quantum.
[[nodiscard]] double ErrorScale(const RangeError& error, double range_m);
[[nodiscard]] double DrawError(const RangeError& error, double range_m, Random& random);
// What the scanner says of a true range: bias, random error and quantum; not below 0.
[[nodiscard]] double Measured(const RangeError& error, double range_m, Random& random);

struct LaserOptions {
  int beams = 360;                            // 1..8192.
  double field_of_view_rad = Radians(270.0);  // Centred on the laser's x axis; a full turn has no beam twice.
  double range_min_m = 0.05;
  double range_max_m = 30.0;  // Farther walls are not seen.
  RangeError error;
  double dropout_share = 0.002;  // Share of all beams, 0..1.
  double sweep_s = 0.0;          // From the first beam to the last; 0: all at once.
  bool clockwise = false;        // The lidar turns clockwise, seen from above: beams run from +half the view down.
  Pose2 T_robot_laser{0.12, 0.0, 0.0};
  double height_m = 0.4;  // Height of the tilt axis above the floor; without effect in a flat world.
};
[[nodiscard]] Result<void> Validate(const LaserOptions& options);

struct Twist {
  double speed_m_s = 0.0;
  double turn_rad_s = 0.0;
};

// A part of a robot's drive with constant velocities. It lasts until the next part begins.
struct DriveLeg {
  double from_s = 0.0;
  Pose2 T_map_robot;  // At from_s.
  Twist twist;
};

// Every beam is measured from where the robot is at the beam's time: `drive` has at least one leg, in the order of
// time; the first one begins with the first beam. `posts` are obstacles that are not part of the scene; they stand
// still during the scan. |tilt| < 90 deg. The scan has no sequence number yet (0); options must be valid.
[[nodiscard]] Scan MeasureScan(const Scene& scene, std::span<const Post> posts, std::span<const DriveLeg> drive,
                               Stamp stamp, double tilt_rad, const LaserOptions& options, Random& random);

// The same for velocities that stay the same throughout the scan; `T_map_robot` at the first beam.
[[nodiscard]] inline Scan MeasureScan(const Scene& scene, std::span<const Post> posts, const Pose2& T_map_robot,
                                      const Twist& twist, Stamp stamp, double tilt_rad, const LaserOptions& options,
                                      Random& random) {
  const DriveLeg leg{0.0, T_map_robot, twist};
  return MeasureScan(scene, posts, std::span(&leg, 1), stamp, tilt_rad, options, random);
}

}  // namespace cairn::sim
