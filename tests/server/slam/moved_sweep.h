// Robots that nobody watched for a while, in many worlds and at many moments: scans and odometry are missing, somebody
// carried the robot, its odometry began anew, or another robot goes on under its name. Counts the poses that are called
// localized beside the truth. Runs the estimator in this process, on simulated drives. Same options, same figures.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/slam/mapper_options.h"

namespace cairn::test {

struct MovedSweepOptions {
  std::vector<std::string> worlds = {"building", "office", "room"};
  int moments = 3;              // On each drive.
  double first_s = 60.0;        // When the first moment is, and ...
  double between_s = 45.0;      // ... the time between two of them.
  double watched_again_s = 60;  // How long each robot is followed afterwards.
  std::uint64_t seed = 1;
  slam::MapperOptions mapper;  // Its number of particles and its seed are those of the sweep.
  // Only kinds whose name contains this.
  std::string only{};
  // Other kinds: robots that are carried between two scans, so that no gap tells that something has happened.
  bool kidnapped = false;
  // Called after every case.
  std::function<void(const struct MovedCase&)> done = [](const struct MovedCase&) {};
};

// One robot at one moment.
struct MovedCase {
  std::string world;
  std::string kind;
  double from_s = 0.0;
  std::uint64_t seed = 0;
  // Poses that were localized and farther than kMovedWrongM from the truth, from where the map of the same drive
  // without a gap shows that place, and from where the present map shows places near it: the drift of an unclosed map
  // is no fault of the gap.
  int wrong = 0;
  double worst_m = 0.0;  // The largest error of a pose that was localized.
  int poses = 0;
  // From the first scan after the gap to the first pose that is localized, and stays so; negative if there is none.
  double found_after_s = -1.0;
  double found_after_m = -1.0;
  // The way from the first scan after the gap to the first pose that is not localized; negative if there is none.
  double noticed_after_m = -1.0;
  // Those of `wrong` at which the robot had driven more than kNoticedWithinM.
  int wrong_later = 0;
  // The way after the gap that leads along the way before it, within kShownM: there its own map shows the robot.
  double shown_m = 0.0;
  bool stood_still = false;  // Nothing had happened to the robot, so that it must go on at once.
};

// The drift of a map whose loop of 100 m is still open is up to 0.65 m in these worlds with these few particles, also
// of robots that are watched all the time. Places that look alike are farther apart.
inline constexpr double kMovedWrongM = 1.0;
// Of a robot that was carried unseen: the way after which its poses must not be called localized at a wrong place.
inline constexpr double kNoticedWithinM = 2.0;
inline constexpr double kShownM = 1.5;

[[nodiscard]] std::vector<MovedCase> RunMovedSweep(const MovedSweepOptions& options);
// The names of what may happen to a robot.
[[nodiscard]] std::vector<std::string> MovedKinds();

}  // namespace cairn::test
