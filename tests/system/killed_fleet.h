// Robots that replay simulated logs to a cairnd which is killed with SIGKILL at random moments and started again on its
// state, beside the same robots and a cairnd that nobody kills. For the test (20 kills) and the study (1,000).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/system/killed_orders.h"

namespace cairn::test {

struct KilledFleetOptions {
  std::string cairnd;  // Paths of the programs.
  std::string cairn;
  std::filesystem::path directory;  // Exists; everything is written there.
  int robots = 2;
  double seconds = 30.0;         // Of each log.
  double rate = 1.0;             // How much faster than the robots drove.
  int kills = 20;                // At most: no robot is left to be disturbed when the logs are at their ends.
  double most_up_s = 1.2;        // A server lives at most this long after it is ready.
  double most_starting_s = 0.3;  // Each third kill is followed by one of a server that lives at most this long at all.
  std::uint64_t seed = 1;
  std::vector<std::string> settings;  // Of both servers: "NAME=VALUE".
  bool ends = false;                  // Their sessions are ended before their paths are compared.
  bool orders = false;  // Meanwhile somebody gives orders (killed_orders.h). The paths are not compared then.
};

struct KilledFleetOutcome {
  int kills = 0;
  int killed_starting = 0;  // Of these, kills of servers that were just started.
  std::uint64_t sent = 0;
  std::uint64_t lost = 0;     // Scans that the undisturbed server used and the killed one did not.
  std::uint64_t doubled = 0;  // Scans that were used or counted more than once.
  std::uint64_t poses = 0;    // Poses told while the fleet drove.
  // Of these, called localized and more than 0.5 m or 0.5 rad beside the pose that the undisturbed server told at this
  // time, or, where orders are given, beside the truth.
  std::uint64_t wrongly_localized = 0;
  // Of these, called localized and more than 0.5 m or 0.5 rad beside the truth; and the same of the undisturbed server.
  // Where a robot drives for long before it sees a place again, the error of its estimate alone is as large.
  std::uint64_t beside_truth = 0, undisturbed_poses = 0, undisturbed_beside_truth = 0;
  double farthest_m = 0.0, undisturbed_farthest_m = 0.0;  // The same as the longest distance.
  std::vector<std::string> wrong;                         // Describes the first of the wrongly localized ones.
  // Robots whose path is not the undisturbed one, to the nanometre that `cairn path` prints.
  int paths_that_differ = 0;
  // About each robot with a loss, a scan used twice or another path: what differs, and the account of its samples.
  std::vector<std::string> differences;
  KilledOrders::Outcome orders;
  std::vector<double> ready_s;     // From each start after a kill until the server answers.
  std::vector<double> tracking_s;  // ... until all robots that still drive get poses from it.
};

// Throws std::runtime_error where a program cannot be started or fails.
[[nodiscard]] KilledFleetOutcome RunKilledFleet(const KilledFleetOptions& options);

}  // namespace cairn::test
