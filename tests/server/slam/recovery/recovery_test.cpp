// Robots that were not watched for a while: scans are missing, somebody carried the robot, its odometry began anew. At
// no time may a pose be called localized beside the truth.
#include "server/slam/recovery/recovery.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <utility>
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
  return static_cast<int>(
      std::ranges::count_if(seen, [](const Seen& one) { return one.outcome.localized && ErrorOf(one) > kWrong_m; }));
}

// The first scan from `since_s` on, and the first localized one.
const Seen* First(const std::vector<Seen>& seen, double since_s, bool localized) {
  const auto found = std::ranges::find_if(
      seen, [&](const Seen& one) { return one.seconds >= since_s && (one.outcome.localized || !localized); });
  return found == seen.end() ? nullptr : &*found;
}

bool Drawn(const std::vector<Seen>& seen, double since_s) {
  const Seen* const first = First(seen, since_s, false);
  const Seen* const found = First(seen, since_s, true);
  return std::any_of(first, found == nullptr ? seen.data() + seen.size() : found,
                     [&](const Seen& one) { return one.chunks != first->chunks || one.keyframes != first->keyframes; });
}

struct Case {
  std::string name;
  Away away;
};
[[maybe_unused]] void PrintTo(const Case& one, std::ostream* out) {
  *out << one.name;
}

const Case kCases[] = {
    {"CarriedALittle", {90.0, 93.0, Odometer::kStandsStill}},
    {"Carried", {230.0, 242.0, Odometer::kStandsStill}},
    {"CarriedFar", {150.0, 190.0, Odometer::kStandsStill}},
    {"OdometryBeginsAnew", {230.0, 242.0, Odometer::kStartsAtZero}},
    {"OdometryBeginsAnewAtOnce", {150.0, 153.0, Odometer::kStartsAtZero, false}},
    {"OdometryWithAGap", {230.0, 270.0, Odometer::kGoesOn}},
    {"AnotherClient", {150.0, 162.0, Odometer::kStartsAtZero, true, true}},
};

class Unwatched : public testing::TestWithParam<Case> {};

TEST_P(Unwatched, IsNotLocalizedUntilItIsFoundAndNeverBesideTheTruth) {
  const Away& away = GetParam().away;
  const std::vector<Seen> seen = Play(Building(), away, away.to_s + 30.0);
  const Seen* const first = First(seen, away.to_s, false);
  ASSERT_NE(first, nullptr);
  EXPECT_GT(ErrorOf(*first), kWrong_m);  // Where it would be if nobody looked.
  EXPECT_FALSE(first->outcome.localized);
  EXPECT_TRUE(first->outcome.reason == PoseReason::kLost || first->outcome.reason == PoseReason::kOdometryOnly);
  EXPECT_GT(first->outcome.covariance(0, 0), 1e-4);
  EXPECT_EQ(Wrong(seen), 0);
  EXPECT_FALSE(Drawn(seen, away.to_s));
  const Seen* const found = First(seen, away.to_s, true);
  ASSERT_NE(found, nullptr);
  EXPECT_LT(ErrorOf(*found), 0.3);
  EXPECT_GT(found->outcome.covariance(0, 0), 1e-3);  // It is as uncertain as the search.
  EXPECT_EQ(seen.back().outcome.reason, PoseReason::kTracking);
}

TEST_P(Unwatched, IsTheSameAfterACheckpointToTheLastBit) {
  const Away& away = GetParam().away;
  std::string whole, stopped;
  static_cast<void>(Play(Building(), away, away.to_s + 15.0, 0, &whole));
  static_cast<void>(Play(Building(), away, away.to_s + 15.0, 10, &stopped));
  EXPECT_FALSE(whole.empty());
  EXPECT_TRUE(whole == stopped);
}

INSTANTIATE_TEST_SUITE_P(Recovery, Unwatched, testing::ValuesIn(kCases),
                         [](const auto& tested) { return tested.param.name; });

// Its scans are held meanwhile: nothing is missing in its map afterwards.
TEST(Recovery, OnItsPathTheRobotGoesOnAsIfThereHadBeenNoPauseOnceItHasProvedItsPlace) {
  // Odometry carries the pose by less than lost_after_m.
  const Away away{.from_s = 170.0, .to_s = 172.4, .odometry_missing = false, .new_client = true};
  const std::vector<Seen> seen = Play(Building(), away, 200.0);
  const Seen* const first = First(seen, away.to_s, false);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->outcome.reason, PoseReason::kOdometryOnly);
  EXPECT_FALSE(first->outcome.localized);
  EXPECT_LT(ErrorOf(*first), 0.3);
  const Seen* const found = First(seen, away.to_s, true);
  ASSERT_NE(found, nullptr);
  EXPECT_LT(found->seconds - away.to_s, 15.0);
  EXPECT_GT(found->keyframes, first->keyframes + 3);
  EXPECT_EQ(Wrong(seen), 0);
}

// Where scans are missing and odometry goes on, the pose is carried by odometry, with the doubt that belongs to it.
TEST(Carried, UntilItIsFoundTheErrorOfThePoseIsWithinThreeSigma) {
  constexpr double kThreeSigma = 11.83;  // Of the square of a distance in two dimensions: 99.73 %.
  constexpr double kFourSigma = 19.33;
  int unsure = 0, beyond = 0;
  for (const double from_s : {90.0, 150.0, 170.0, 230.0}) {
    for (const double gap_s : {2.4, 10.0, 30.0}) {
      SCOPED_TRACE(testing::Message() << gap_s << " s without scans from " << from_s << " s on");
      const Away away{.from_s = from_s, .to_s = from_s + gap_s, .odometry_missing = false, .new_client = true};
      const std::vector<Seen> seen = Play(Building(), away, away.to_s + 20.0);
      EXPECT_EQ(Wrong(seen), 0);
      for (const Seen& one : seen) {
        if (one.seconds < away.to_s || one.outcome.localized) continue;
        ++unsure;
        const Eigen::Vector2d error = one.outcome.T_map_robot.translation() - one.T_map_robot_true.translation();
        const Eigen::Matrix2d covariance = one.outcome.covariance.topLeftCorner<2, 2>();
        const double squared_sigmas = error.dot(covariance.ldlt().solve(error));
        beyond += squared_sigmas < kThreeSigma ? 0 : 1;
        EXPECT_LT(squared_sigmas, kFourSigma)
            << "at " << one.seconds << " s " << error.norm() << " m beside the truth, sigma "
            << std::sqrt(covariance(0, 0)) << ", " << std::sqrt(covariance(1, 1)) << " m";
      }
    }
  }
  EXPECT_GT(unsure, 50);
  EXPECT_LE(beyond, unsure / 50);
}

// A robot that drives along the x axis of a world of walls, five scans a second.
class Driver {
 public:
  explicit Driver(test::World world) : world_(std::move(world)) {}

  // A scan at `truth`, `later_s` after the last one.
  ScanOutcome Process(const Pose2& truth, const Pose2& T_odom_robot, Passage passage = Passage::kDriven,
                      double later_s = 0.2, double tilt_rad = 0.0) {
    Scan scan = test::Look(world_, truth, {.beams = 181, .step_rad = Radians(1.5), .sigma_m = 0.01}, &rng_);
    scan.stamp = (stamp_ += StampFromSeconds(later_s));
    scan.tilt_rad = tilt_rad;
    return mapper_.Process(std::make_shared<const Scan>(std::move(scan)), T_odom_robot, SerialFor, passage);
  }
  void Relocalise(const std::optional<Pose2>& T_map_robot) { mapper_.Relocalise(T_map_robot); }
  // Returns the last x.
  double DriveTo(double end_x) {
    double x = 0.0;
    for (; x < end_x; x += 0.2) EXPECT_TRUE(Process({x, 0, 0}, {x, 0, 0}).localized);
    return x - 0.2;
  }

 private:
  const test::World world_;
  std::mt19937_64 rng_{3};
  Mapper mapper_{FewParticles(), {}, 1};
  Stamp stamp_ = 0;
};

// Whether a robot that has stood still is localized at once, however long it stood, and one that was carried by 0.7 m
// is not.
TEST(Recovery, ARobotThatStoodStillGoesOnAtOnce) {
  for (const double pause_s : {4.0, 3600.0}) {
    for (const double carried_m : {0.0, 0.7}) {
      Driver robot(test::RingCorridor(true));
      const double x = robot.DriveTo(20.0);
      const ScanOutcome outcome = robot.Process({x + carried_m, 0, 0}, {x, 0, 0}, Passage::kPaused, pause_s);
      EXPECT_EQ(outcome.localized, carried_m == 0.0) << carried_m;
    }
  }
}

// After a short pause, odometry, scan and map together are enough.
TEST(Recovery, ARobotThatDroveOnDuringAShortPauseGoesOnAtOnce) {
  for (const double pause_s : {4.0, 60.0}) {
    Driver robot(test::RingCorridor(true));
    const double x = robot.DriveTo(20.0);
    EXPECT_EQ(robot.Process({x + 1.6, 0, 0}, {x + 1.6, 0, 0}, Passage::kPaused, pause_s).localized, pause_s < 10.0);
  }
  // Odometry does not show that it was turned.
  Driver robot(test::RingCorridor(true));
  const double x = robot.DriveTo(20.0);
  EXPECT_FALSE(robot.Process({x + 1.6, 0, 0.2}, {x + 1.6, 0, 0}, Passage::kPaused, 4.0).localized);
}

// A tilted scan cannot confirm a place, so that the next level scan has to.
TEST(Recovery, APauseThatEndsWithATiltedScanIsNotForgotten) {
  for (const Passage passage : {Passage::kDriven, Passage::kPaused}) {
    Driver robot(test::RingCorridor(true));
    const double x = robot.DriveTo(20.0);
    static_cast<void>(robot.Process({x, 0, 0}, {x, 0, 0}, passage, 4.0, 0.2));
    EXPECT_EQ(robot.Process({x + 0.2, 0, 0}, {x + 0.2, 0, 0}).localized, passage == Passage::kDriven);
  }
}

// Somebody carries the robot, which does not notice it, and says where it is.
TEST(Recovery, ARobotIsFoundWhereItIsSaidToBeAndNowhereElse) {
  for (const double said_x : {8.6, 13.0}) {
    Driver robot(test::RingCorridor(true));
    const double x = robot.DriveTo(20.0);
    robot.Relocalise(Pose2{said_x, 0.3, 0.1});
    std::optional<double> found_m;
    for (double way = 0.0; way < 3.0 && !found_m; way += 0.2) {
      const ScanOutcome outcome = robot.Process({8.0 + way, 0, 0}, {x + way, 0, 0});
      if (!outcome.localized) continue;
      found_m = way;
      EXPECT_NEAR(outcome.T_map_robot.x, 8.0 + way, 0.1);
    }
    EXPECT_EQ(found_m.has_value(), said_x < 10.0);
  }
}

TEST(Recovery, ARobotOfWhichOnlyIsSaidThatItIsElsewhereHasToProveItsPlace) {
  Driver robot(test::RingCorridor(true));
  const double x = robot.DriveTo(20.0);
  robot.Relocalise(std::nullopt);
  const ScanOutcome outcome = robot.Process({x, 0, 0}, {x, 0, 0});
  EXPECT_FALSE(outcome.localized);
  EXPECT_EQ(outcome.reason, PoseReason::kLost);
}

// A robot that was switched off before one room and on again before another one that looks the same.
TEST(Recovery, WhereRoomsLookAlikeTheRobotStaysLost) {
  Driver robot(test::RingOfEqualRooms());
  static_cast<void>(robot.DriveTo(28.0));
  const double from = 12.0;  // Carried back by four rooms.
  for (double way = 0.0; way < 8.0; way += 0.2) {
    const ScanOutcome outcome =
        robot.Process({from + way, 0, 0}, {way, 0, 0}, way == 0.0 ? Passage::kUnknown : Passage::kDriven);
    EXPECT_FALSE(outcome.localized && std::abs(outcome.T_map_robot.x - from - way) > kWrong_m) << way;
    EXPECT_FALSE(outcome.localized) << way;
    EXPECT_EQ(outcome.reason, PoseReason::kLost);
  }
}

}  // namespace
}  // namespace cairn::slam
