// Robots that were not watched for a while: scans are missing, somebody carried the robot, its odometry began anew. At
// no time may a pose be called localized beside the truth.
#include "server/slam/recovery.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

constexpr double kWrong_m = 0.5;

// What becomes of the odometry while nobody watches.
enum class Odometer { kGoesOn, kStandsStill, kStartsAtZero };

struct Away {
  double from_s = 0.0;
  double to_s = 0.0;
  Odometer odometer = Odometer::kGoesOn;
  bool odometry_missing = true;  // As the scans are.
  bool new_client = false;
};

struct Seen {
  ScanOutcome outcome;
  Pose2 T_map_robot_true;
  double seconds = 0.0;
  std::size_t chunks = 0;
  std::size_t keyframes = 0;
};

struct Record {
  double seconds = 0.0;
  LogRecord record;
};

struct WholeDrive {
  Pose2 T_map_robot_start;
  std::vector<Record> records;
  Trajectory truth;
};

// Several times round through the world; every test takes its part of it.
WholeDrive DriveThrough(const std::string& world, double seconds) {
  sim::FleetOptions options;
  options.robots = 1;
  options.scan_hz = 5.0;
  options.odometry_hz = 10.0;
  options.laser.beams = 181;
  auto fleet = sim::Fleet::Create(*sim::OpenWorld(world), options);
  WholeDrive drive{fleet->T_map_robot_start(0), {}, {}};
  for (double now = 0.0; now < seconds;) {
    LogRecord record = fleet->Next().record;
    const Stamp stamp = std::visit([](const auto& one) { return one.stamp; }, record);
    now = SecondsFromStamp(stamp - options.first_stamp);
    drive.records.push_back({now, std::move(record)});
  }
  drive.truth = fleet->truth(0);
  return drive;
}

const WholeDrive& Building() {
  static const WholeDrive drive = DriveThrough("building", 400.0);
  return drive;
}

MapperOptions FewParticles() {
  MapperOptions options;
  options.filter.particles = 20;
  return options;
}

// Drives with the robot unwatched as `away` says. With `stop_every` the estimator is saved and another goes on.
std::vector<Seen> Play(const WholeDrive& drive, const Away& away, double until_s, int stop_every = 0,
                       std::string* state = nullptr) {
  std::vector<Seen> seen;
  std::unique_ptr<ScanPipeline> pipeline;
  const auto make = [&](const Pose2& start) {
    return std::make_unique<ScanPipeline>(
        FewParticles(), start, SerialFor,
        ScanPipeline::Sink{.used =
                               [&](const Scan& scan, const ScanOutcome& outcome) {
                                 const Pose2 truth = *PoseOn(drive.truth, scan.stamp, 1.0);
                                 const double seconds = SecondsFromStamp(scan.stamp - drive.truth.front().stamp);
                                 seen.push_back({outcome, truth, seconds, pipeline->mapper().grid().chunk_count(),
                                                 pipeline->mapper().keyframe_count()});
                               },
                           .dropped = [](const Scan&, DropReason) {}});
  };
  pipeline = make(drive.T_map_robot_start);
  Pose2 last_odometry, T_new_old;
  bool after = false;
  int scans = 0;
  for (const auto& [seconds, record] : drive.records) {
    if (seconds > until_s) break;
    const bool missing = seconds >= away.from_s && seconds < away.to_s;
    if (const auto* const scan = std::get_if<Scan>(&record)) {
      if (!missing) pipeline->Add(std::make_shared<const Scan>(*scan));
      if (stop_every == 0 || ++scans % stop_every != 0) continue;
      std::string bytes;
      pipeline->Save(bytes);
      pipeline = make({});
      EXPECT_TRUE(pipeline->Load(bytes));
      continue;
    }
    if (missing && away.odometry_missing) continue;
    Odometry odometry = std::get<Odometry>(record);
    if (seconds >= away.to_s && !std::exchange(after, true)) {
      if (away.new_client) pipeline->NewClient();
      const Pose2 old_odom = odometry.T_odom_robot;
      if (away.odometer == Odometer::kStandsStill) T_new_old = last_odometry * old_odom.Inverse();
      if (away.odometer == Odometer::kStartsAtZero) T_new_old = old_odom.Inverse();
    }
    odometry.T_odom_robot = T_new_old * odometry.T_odom_robot;
    last_odometry = odometry.T_odom_robot;
    pipeline->Add(odometry);
  }
  pipeline->Finish();
  if (state != nullptr) pipeline->Save(*state);
  return seen;
}

double ErrorOf(const Seen& seen) {
  return (seen.outcome.T_map_robot.translation() - seen.T_map_robot_true.translation()).norm();
}

int Wrong(const std::vector<Seen>& seen) {
  return static_cast<int>(std::ranges::count_if(
      seen, [](const Seen& one) { return one.outcome.localized && ErrorOf(one) > kWrong_m; }));
}

// The first scan from `since_s` on, and the first localized one.
const Seen* First(const std::vector<Seen>& seen, double since_s, bool localized) {
  const auto found = std::ranges::find_if(
      seen, [&](const Seen& one) { return one.seconds >= since_s && (one.outcome.localized || !localized); });
  return found == seen.end() ? nullptr : &*found;
}

TEST(Recovery, Explore) {
  for (const Odometer odometer : {Odometer::kGoesOn, Odometer::kStandsStill, Odometer::kStartsAtZero}) {
    for (const bool missing : {false, true}) {
      for (const double from : {40.0, 90.0, 130.0, 170.0, 200.0, 230.0}) {
        for (const double length : {3.0, 12.0, 40.0}) {
          const auto seen = Play(Building(), {from, from + length, odometer, missing}, from + length + 60.0);
          const Seen* first = First(seen, from + length, false);
          const Seen* back = First(seen, from + length, true);
          printf("odo %d missing %d from %.0f len %.0f: wrong %d first %d %d score %.2f err %.2f back after %.1f err %.2f n %zu\n",
                 static_cast<int>(odometer), missing, from, length, Wrong(seen),
                 first ? static_cast<int>(first->outcome.reason) : -1, first ? first->outcome.localized : -1,
                 first ? first->outcome.score : 0.0, first ? ErrorOf(*first) : 0.0,
                 back ? back->seconds - from - length : -1.0, back ? ErrorOf(*back) : 0.0, seen.size());
        }
      }
    }
  }
}

}  // namespace
}  // namespace cairn::slam
