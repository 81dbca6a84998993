// The odometry of a differential drive whose wheels differ from what its software assumes.
// Systematic: each wheel's circumference and the distance between the wheels are wrong by a fixed share. Random: each
// wheel slips, with a variance that grows with the way it rolls (k^2 * |way|), so the error does not depend on how
// finely the motion is cut. Frame: `odom`, which starts where the robot starts.
// Sources: Borenstein, Feng 1996 (UMBmark: wheel diameters and base); Chong, Kleeman, ICRA 1997 (random part).
#pragma once

#include "client/sim/random.h"
#include "common/geometry/pose2.h"
#include "common/status.h"

namespace cairn::sim {

struct WheelOptions {
  double base_m = 0.45;     // Between the wheels, in truth.
  double left_share = 0.0;  // The left wheel's way reads (1 + left_share) times the truth.
  double right_share = 0.0;
  double base_share = 0.0;           // The software assumes base_m * (1 + base_share).
  double slip_m_per_sqrt_m = 0.004;  // k: standard deviation of one wheel's way after 1 m.
};
[[nodiscard]] Result<void> Validate(const WheelOptions& options);

// How much robots of the same make differ: standard deviations of the three shares.
struct WheelSpread {
  double wheel_share = 0.004;
  double base_share = 0.01;
};
[[nodiscard]] WheelOptions DrawWheels(const WheelOptions& mean, const WheelSpread& spread, Random& random);

class WheelOdometry {
 public:
  explicit WheelOdometry(const WheelOptions& options) : options_(options) {}

  // In truth the robot drove `way_m` along an arc and turned by `turn_rad`.
  void Drive(double way_m, double turn_rad, Random& random);
  [[nodiscard]] const Pose2& T_odom_robot() const { return T_odom_robot_; }

 private:
  const WheelOptions options_;
  Pose2 T_odom_robot_;
};

}  // namespace cairn::sim
