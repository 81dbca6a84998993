// Two robots of a site that nobody has told where they start: what of the second is shown, and when.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/eventually.h"
#include "tests/server/slam/ring_world.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kOther = 8;

ServerOptions JoiningOptions(bool join) {
  ServerOptions options = TestOptions();
  options.jobs.join = join;
  options.jobs.join_way_m = 15.0;
  options.robots.checkpoint_entries = 50;  // So that a restart begins with one.
  return options;
}

// A robot on its way round a ring of corridors, anticlockwise, from some place on. Its odometry begins at the origin
// there, and turns a little too far with every metre.
class RingRobot {
 public:
  RingRobot(std::string name, ClientId client, double from_m, double metres)
      : name_(std::move(name)), client_(client), engine_(client) {
    for (const Pose2& step : slam::test::RingSteps(from_m, kStepM)) T_ring_robot_ = T_ring_robot_ * step;
    const std::size_t before = slam::test::RingSteps(from_m, kStepM).size();
    steps_ = slam::test::RingSteps(from_m + metres, kStepM);
    steps_.erase(steps_.begin(), steps_.begin() + static_cast<std::ptrdiff_t>(before));
  }

  void Open(WholeServer& house) const { house.Open(name_, client_, "lab", std::nullopt); }
  void SayStarted(WholeServer& house) const { testing::SayStarted(house, name_, client_); }
  void Drive(WholeServer& house, std::size_t count) {
    const slam::test::Laser laser{.first_rad = -kPi / 2, .range_max_m = 12.0, .sigma_m = 0.01};
    for (; count > 0 && next_ < steps_.size(); --count, ++next_) {
      const Pose2& step = steps_[next_];
      T_ring_robot_ = T_ring_robot_ * step;
      T_odom_robot_ = T_odom_robot_ * step * Pose2{0.0, 0.0, 0.0002 * step.translation().norm()};
      Scan scan = slam::test::Look(World(), T_ring_robot_, laser, &engine_);
      scan.sequence = ++sequence_;
      scan.stamp = static_cast<Stamp>(sequence_) * 200'000'000;
      house.SendOdometry(name_, client_, {sequence_, scan.stamp, T_odom_robot_});
      house.SendScan(name_, client_, std::move(scan));
      if (sequence_ % 16 == 0) WaitSettled(house, sequence_);
    }
    // The last scan waits for the odometry after it.
    WaitSettled(house, sequence_ - 1);
  }
  [[nodiscard]] std::size_t left() const { return steps_.size() - next_; }
  // The distance between a pose of the last step and the truth, in the frame of a robot that began at the beginning of
  // the ring.
  [[nodiscard]] double Error(const PoseReport& pose) const {
    return (pose.T_map_robot.translation() - T_ring_robot_.translation()).norm();
  }
  [[nodiscard]] PoseReport LastPose(const WholeServer& house) const {
    PoseReport last;
    for (const PoseReport& pose : house.All<PoseReport>()) {
      if (pose.robot == name_) last = pose;
    }
    return last;
  }

 private:
  // Of this session, not of an earlier one of the robot.
  void WaitSettled(const WholeServer& house, std::uint64_t sequence) const {
    ASSERT_TRUE(house.WaitFor([&] {
      const Ledger ledger = house.LastLedger(name_);
      return ledger.session == client_ && ledger.settled_through >= sequence;
    })) << sequence;
  }
  static constexpr double kStepM = 0.2;
  static const slam::test::World& World() {
    static const slam::test::World world = slam::test::RingCorridor(true);
    return world;
  }

  const std::string name_;
  const ClientId client_;
  std::mt19937_64 engine_;
  std::vector<Pose2> steps_;
  std::size_t next_ = 0;
  std::uint64_t sequence_ = 0;
  Pose2 T_ring_robot_, T_odom_robot_;
};

RingRobot FirstRobot() {
  return {"r1", kDriver, 0.0, 60.0};
}
RingRobot SecondRobot() {
  return {"r2", kOther, 16.0, 50.0};
}

MapInfo InfoOf(WholeServer& house) {
  const Reply reply = house.Ask(About(RequestKind::kMapInfo));
  return reply.maps.empty() ? MapInfo{} : reply.maps[0];
}

// The last of the jobs that have joined robots; nothing: there is none.
std::optional<Job> JoinedBy(const WholeServer& house) {
  std::optional<Job> last;
  for (const Job& job : house.All<Job>()) {
    if (job.kind == JobKind::kJoin && job.state == JobState::kSucceeded && job.map_version > 0) last = job;
  }
  return last;
}

Reply Enable(WholeServer& house, std::uint32_t version) {
  Request request = About(RequestKind::kMapEnable);
  request.map_version = version;
  return house.Ask(request);
}

TEST(Joining, ARobotWithoutAStartIsLocalizedOnceAJobHasJoinedItAndNotBefore) {
  WholeServer house(JoiningOptions(true));
  RingRobot first = FirstRobot(), second = SecondRobot();
  first.Open(house);
  first.Drive(house, first.left());
  EXPECT_TRUE(first.LastPose(house).localized);  // It has begun the map.

  second.Open(house);
  second.Drive(house, 40);
  EXPECT_FALSE(second.LastPose(house).localized);
  EXPECT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);

  second.Drive(house, second.left() - 20);
  ASSERT_TRUE(house.WaitFor([&] { return JoinedBy(house).has_value(); }));
  const Job job = *JoinedBy(house);
  ASSERT_TRUE(house.WaitFor([&] { return InfoOf(house).enabled_version == job.map_version; }));
  second.Drive(house, 10);
  EXPECT_TRUE(second.LastPose(house).localized);
  EXPECT_LT(second.Error(second.LastPose(house)), 0.5);
  EXPECT_LT(first.Error(first.LastPose(house)), 0.5);

  // Going back to the version before takes it out of the map again.
  ASSERT_TRUE(Enable(house, 1).status.ok());
  second.Drive(house, 10);
  EXPECT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);
  EXPECT_EQ(InfoOf(house).epoch, 2U);
}

TEST(Joining, TheMapIsTheSameWithAndWithoutAFragment) {
  const auto map_of = [](bool with_fragment) {
    WholeServer house(JoiningOptions(false));
    RingRobot first = FirstRobot(), second = SecondRobot();
    first.Open(house);
    first.Drive(house, first.left());
    if (with_fragment) {
      second.Open(house);
      second.Drive(house, second.left());
    }
    house.Stop();  // Only then the last of it is published.
    std::map<TileKey, std::vector<std::uint8_t>> bytes;
    for (const auto& [key, tile] : house.CurrentTiles()) bytes[key] = tile.bytes;
    return bytes;
  };
  const auto alone = map_of(false);
  EXPECT_GT(alone.size(), 20U);
  EXPECT_EQ(map_of(true), alone);
}

// What a robot has drawn whose start was refused is in no tile, also not in those of the next server.
TEST(Joining, OfARobotWhoseStartWasRefusedTheMapShowsNothing) {
  const TempDirectory directory;
  const auto tiles_of = [](WholeServer& house) {
    house.Stop();
    std::map<TileKey, std::vector<std::uint8_t>> bytes;
    for (const auto& [key, tile] : house.CurrentTiles()) bytes[key] = tile.bytes;
    return bytes;
  };
  std::map<TileKey, std::vector<std::uint8_t>> alone;
  {
    StoredServer server(directory.path(), JoiningOptions(false));
    server->Open("r1", kDriver);
    server->Drive("r1", kDriver, 0, 120);
    alone = tiles_of(server.house());
  }
  constexpr int kStepsPerMetre = 20;
  int metre = 0;
  const auto drive = [&metre](WholeServer& house) {
    house.Drive("r2", kOther, metre * kStepsPerMetre, (metre + 1) * kStepsPerMetre);
    ++metre;
    return house.All<PoseReport>().back();
  };
  {
    StoredServer server(directory.path(), JoiningOptions(false));
    server->Open("r2", kOther, "lab", Pose2{2.0, 1.5, 0.0});
    // It halts after each metre until the server has had time to look at it.
    const auto is_refused = [&] {
      return server->LastState("r2", kOther).status.code == StatusCode::kFailedPrecondition;
    };
    while (metre < 7 && !test::Eventually(is_refused, std::chrono::milliseconds(1500))) drive(server.house());
    ASSERT_TRUE(is_refused());
    EXPECT_EQ(drive(server.house()).reason, PoseReason::kNotJoined);
    EXPECT_EQ(tiles_of(server.house()), alone);
  }
  StoredServer server(directory.path(), JoiningOptions(false));
  SayStarted(server.house(), "r2", kOther);
  EXPECT_EQ(drive(server.house()).reason, PoseReason::kNotJoined);
  EXPECT_EQ(server->LastState("r2", kOther).status.code, StatusCode::kFailedPrecondition);
  EXPECT_EQ(tiles_of(server.house()), alone);
}

TEST(Joining, IsAsItWasAfterRestarts) {
  const TempDirectory directory;
  RingRobot first = FirstRobot(), second = SecondRobot();
  {
    StoredServer server(directory.path(), JoiningOptions(false));
    first.Open(server.house());
    first.Drive(server.house(), first.left());
    second.Open(server.house());
    second.Drive(server.house(), second.left() - 30);
    EXPECT_EQ(second.LastPose(server.house()).reason, PoseReason::kNotJoined);
  }
  {  // It is still apart, and what it has driven before counts.
    StoredServer server(directory.path(), JoiningOptions(false));
    second.SayStarted(server.house());
    second.Drive(server.house(), 10);
    EXPECT_EQ(second.LastPose(server.house()).reason, PoseReason::kNotJoined);
  }
  {
    StoredServer server(directory.path(), JoiningOptions(true));
    ASSERT_TRUE(server->WaitFor([&] { return JoinedBy(server.house()).has_value(); }));
    ASSERT_TRUE(server->WaitFor([&] { return InfoOf(server.house()).enabled_version > 1; }));
    second.SayStarted(server.house());
    second.Drive(server.house(), 10);
    EXPECT_TRUE(second.LastPose(server.house()).localized);
  }
  StoredServer server(directory.path(), JoiningOptions(true));
  second.SayStarted(server.house());
  second.Drive(server.house(), 10);
  EXPECT_TRUE(second.LastPose(server.house()).localized);
  EXPECT_LT(second.Error(second.LastPose(server.house())), 0.5);
  EXPECT_EQ(JoinedBy(server.house())->id, 1U);  // No other job was needed.
}

// With a filter that cannot continue on another path, a fragment would report poses in its own frame as places of the
// map once a job had joined it.
class WithFilter : public ::testing::TestWithParam<slam::FilterKind> {};

TEST_P(WithFilter, ARobotThatCannotFollowAJobIsNeverCalledLocalized) {
  ServerOptions options = JoiningOptions(true);
  options.slam.filter.kind = GetParam();
  WholeServer house(options);
  RingRobot first = FirstRobot(), second = SecondRobot();
  first.Open(house);
  first.Drive(house, first.left());
  EXPECT_TRUE(first.LastPose(house).localized);
  second.Open(house);
  second.Drive(house, second.left() - 20);
  const SessionState told = house.LastState("r2", kOther);
  EXPECT_EQ(told.status.code, StatusCode::kFailedPrecondition);
  EXPECT_NE(told.status.message.find("start pose"), std::string::npos) << told.status.message;

  // Nobody submits a job by itself; one that somebody asks for finds where the robot is, and the robot does not follow.
  EXPECT_TRUE(house.All<Job>().empty());
  const Reply submitted = house.Ask(About(RequestKind::kJobSubmit));
  ASSERT_EQ(submitted.jobs.size(), 1U);
  const Job job = house.WaitJob(submitted.jobs[0].id);
  ASSERT_EQ(job.state, JobState::kSucceeded) << job.message;
  ASSERT_NE(job.message.find("its filter cannot continue there"), std::string::npos) << job.message;
  ASSERT_TRUE(Enable(house, job.map_version).status.ok());
  second.Drive(house, 10);
  EXPECT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);
  EXPECT_FALSE(second.LastPose(house).localized);
}

INSTANTIATE_TEST_SUITE_P(Joining, WithFilter,
                         ::testing::Values(slam::FilterKind::kNone, slam::FilterKind::kLandmarkCorrection,
                                           slam::FilterKind::kDpSlam),
                         [](const auto& kind) { return std::to_string(static_cast<int>(kind.param)); });

// The next day the robot stands elsewhere, and nobody says where.
TEST(Joining, ARobotIsFittedToWhatItSawInAnEarlierSession) {
  const TempDirectory directory;
  RingRobot first = FirstRobot();
  {
    StoredServer server(directory.path(), JoiningOptions(true));
    first.Open(server.house());
    first.Drive(server.house(), first.left());
    server->End("r1", kDriver);
    ASSERT_TRUE(server->WaitPhase("r1", kDriver, SessionPhase::kEnded));
  }
  RingRobot again("r1", kOther, 16.0, 50.0);
  const auto joins = [&](StoredServer& server) {
    ASSERT_TRUE(server->WaitFor([&] { return JoinedBy(server.house()).has_value(); }));
    const std::uint32_t version = JoinedBy(server.house())->map_version;
    ASSERT_TRUE(server->WaitFor([&] { return InfoOf(server.house()).enabled_version == version; }));
  };
  {
    StoredServer server(directory.path(), JoiningOptions(true));
    again.Open(server.house());
    again.Drive(server.house(), 40);
    EXPECT_EQ(again.LastPose(server.house()).reason, PoseReason::kNotJoined);
    again.Drive(server.house(), again.left() - 20);
    ASSERT_NO_FATAL_FAILURE(joins(server));
    again.Drive(server.house(), 10);
    EXPECT_TRUE(again.LastPose(server.house()).localized);
    EXPECT_LT(again.Error(again.LastPose(server.house())), 0.5);
    EXPECT_EQ(InfoOf(server.house()).robots, 1U);
  }
  // Both sessions are there after a restart, and a smoothing job fits both.
  StoredServer server(directory.path(), JoiningOptions(true));
  const Reply submitted = server->Ask(About(RequestKind::kJobSubmit));
  ASSERT_EQ(submitted.jobs.size(), 1U);
  const Job job = server->WaitJob(submitted.jobs[0].id);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_NE(job.message.find("joined 2"), std::string::npos) << job.message;
}

}  // namespace
}  // namespace cairn::server::testing
