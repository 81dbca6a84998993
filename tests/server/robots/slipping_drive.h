// A drive once round a large ring and on. On three metres the robot sees nothing and its wheels slip; when it sees the
// beginning again, it corrects its path by itself. It starts at the origin of the world and of its map.
#pragma once

#include <cstdint>
#include <limits>
#include <utility>

#include "tests/server/slam/ring_world.h"
#include "tests/server/support/room_world.h"

namespace cairn::server::testing {

inline constexpr Stamp kSlippingPeriod = 2 * kScanPeriod;  // Its wheels slip at 2 m/s.
inline constexpr std::uint64_t kAfterTheSlip = 400;        // Number of the first scan that sees where it is again.

// `take(odometry, scan)` gets all that it sends, `after_the_slip(truth)` is called once scan kAfterTheSlip was taken.
template <typename Take, typename AfterTheSlip>
void DriveWithASlip(Take&& take, AfterTheSlip&& after_the_slip) {
  const auto world = slam::test::RingCorridor(true);
  const slam::test::Laser laser{.beams = 181, .step_rad = Radians(1.0), .range_max_m = 12.0};
  Pose2 truth, odometry;
  double way_m = 0.0;
  std::uint64_t number = 0;
  for (const Pose2& step : slam::test::RingSteps(140.0, 0.25)) {
    const bool blind = way_m > 70.0 && way_m < 73.0;
    Scan scan = slam::test::Look(world, truth, laser);
    if (blind) scan.ranges_m.assign(scan.ranges_m.size(), std::numeric_limits<float>::infinity());
    scan.sequence = ++number;
    const Stamp stamp = scan.stamp = static_cast<Stamp>(number) * kSlippingPeriod;
    take(Odometry{number, stamp, odometry}, std::move(scan));
    if (number == kAfterTheSlip) after_the_slip(truth);
    truth = truth * step;
    odometry = odometry * Pose2{(blind ? 1.6 : 1.0) * step.x, 0.0, step.theta};
    way_m += step.x;
  }
}

}  // namespace cairn::server::testing
