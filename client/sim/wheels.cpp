#include "client/sim/wheels.h"

#include <cmath>

#include "client/sim/arc.h"

namespace cairn::sim {

Result<void> Validate(const WheelOptions& o) {
  if (!(o.base_m > 0.0 && o.base_m <= 10.0)) {
    return Fail(StatusCode::kInvalidArgument, "wheels: the base must be above 0 and at most 10 m");
  }
  for (const double share : {o.left_share, o.right_share, o.base_share}) {
    if (!(std::abs(share) <= 0.5)) return Fail(StatusCode::kInvalidArgument, "wheels: errors must be within +-0.5");
  }
  if (!(o.slip_m_per_sqrt_m >= 0.0 && o.slip_m_per_sqrt_m <= 1.0)) {
    return Fail(StatusCode::kInvalidArgument, "wheels: slip must be 0..1 m per square root of a metre");
  }
  return {};
}

WheelOptions DrawWheels(const WheelOptions& mean, const WheelSpread& spread, Random& random) {
  WheelOptions drawn = mean;
  drawn.left_share += Normal(random, spread.wheel_share);
  drawn.right_share += Normal(random, spread.wheel_share);
  drawn.base_share += Normal(random, spread.base_share);
  return drawn;
}

void WheelOdometry::Drive(double way_m, double turn_rad, Random& random) {
  const auto reads = [&](double wheel_way, double share) {
    return wheel_way * (1.0 + share) + Normal(random, options_.slip_m_per_sqrt_m * std::sqrt(std::abs(wheel_way)));
  };
  const double left = reads(way_m - turn_rad * options_.base_m / 2, options_.left_share);
  const double right = reads(way_m + turn_rad * options_.base_m / 2, options_.right_share);
  const double believed_base = options_.base_m * (1.0 + options_.base_share);
  T_odom_robot_ = T_odom_robot_ * DriveArc((left + right) / 2, (right - left) / believed_base);
}

}  // namespace cairn::sim
