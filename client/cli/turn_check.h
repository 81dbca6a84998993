// Whether the turns that scans show are those of the odometry: at once, some time later, or mirrored. Two scans that
// follow each other are compared as they stand, by shifting one along its angles, which is exact to about a degree
// while the robot hardly moves. Enough to see a lag or an array that is turned over, and not a calibration:
// that is cairn-calibrate laser. Bounded memory. One thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"

namespace cairn::client {

struct TurnFinding {
  std::uint64_t pairs = 0;   // Pairs of scans in which the scans or the odometry turned.
  double correlation = 0.0;  // Between both turns at the best lag, with the sign of the turn; 0 if there are too few.
  double correlation_at_once = 0.0;
  double lag_s = 0.0;  // Stamps of scans are later by this than the odometry's.
  // The farthest that scans have turned, to one side, while odometry stood still.
  double turned_while_standing_rad = 0.0;
};

class TurnCheck {
 public:
  static constexpr double kWidest_s = 1.0, kStep_s = 0.02;

  void Add(const Scan& scan);
  void Add(const Odometry& odometry);
  [[nodiscard]] TurnFinding Finish();

 private:
  static constexpr int kLags = 2 * static_cast<int>(kWidest_s / kStep_s + 0.5) + 1;
  struct Pair {
    Stamp from = 0;
    Stamp to = 0;
    double turn_rad = 0.0;
  };
  struct Sums {
    double xy = 0.0, xx = 0.0, yy = 0.0;
    std::uint64_t count = 0;

    [[nodiscard]] double Correlation() const;
  };

  void Settle(const Pair& pair);
  void AddStanding(double odometry_turn_rad, double scan_turn_rad);
  [[nodiscard]] std::optional<double> HeadingAt(Stamp stamp) const;

  struct Profile {
    Stamp stamp = 0;
    double step_rad = 0.0;
    std::vector<float> ranges_m;  // 0: nothing known.
  };
  std::optional<Profile> last_;
  std::deque<Pair> waiting_;       // Odometry does not reach far enough yet.
  std::deque<Odometry> odometry_;  // The last seconds.
  std::array<Sums, kLags> sums_{};
  double standing_turn_rad_ = 0.0;  // Of the scans, since odometry stands still,
  double standing_most_rad_ = 0.0;  // and the most of all such times.
};

}  // namespace cairn::client
