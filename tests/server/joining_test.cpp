// Two robots of a site that nobody has told where they start: what of the second is shown, and when.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/eventually.h"
#include "tests/server/slam/ring_world.h"
#include "tests/server/support/stored_server.h"
#include "tests/server/support/walled_robot.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// A robot on its way round a ring of corridors, anticlockwise, from some place on.
class RingRobot : public WalledRobot {
 public:
  RingRobot(const std::string& name, ClientId client, double from_m, double metres)
      : WalledRobot(name, client, World(), kLaser, StartAt(from_m), StepsFrom(from_m, metres)) {}

 private:
  static constexpr double kStepM = 0.2;
  static constexpr slam::test::Laser kLaser{.first_rad = -kPi / 2, .range_max_m = 12.0, .sigma_m = 0.01};
  static const slam::test::World& World() {
    static const slam::test::World world = slam::test::RingCorridor(true);
    return world;
  }
  static Pose2 StartAt(double from_m) {
    Pose2 start;
    for (const Pose2& step : slam::test::RingSteps(from_m, kStepM)) start = start * step;
    return start;
  }
  static std::vector<Pose2> StepsFrom(double from_m, double metres) {
    const std::size_t before = slam::test::RingSteps(from_m, kStepM).size();
    std::vector<Pose2> steps = slam::test::RingSteps(from_m + metres, kStepM);
    steps.erase(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(before));
    return steps;
  }
};

RingRobot FirstRobot() {
  return {"r1", kDriver, 0.0, 60.0};
}
RingRobot SecondRobot() {
  return {"r2", kOther, 16.0, 50.0};
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

// A person has gone back to the version before it was joined. Neither its own way nor that of another robot brings it
// back, also after a restart, until a person asks for a job.
TEST(Joining, ARobotThatAPersonHasTakenOutOfTheMapStaysOutWhereAnotherIsJoined) {
  const TempDirectory directory;
  constexpr ClientId kThird = 9;
  RingRobot first = FirstRobot(), second("r2", kOther, 16.0, 70.0), third("r3", kThird, 8.0, 50.0);
  const auto wait_joined = [](WholeServer& house) {
    ASSERT_TRUE(house.WaitFor([&] { return JoinedBy(house).has_value(); }));
    ASSERT_TRUE(house.WaitFor([&] { return InfoOf(house).enabled_version == JoinedBy(house)->map_version; }));
  };
  {
    StoredServer server(directory.path(), JoiningOptions(true));
    WholeServer& house = server.house();
    first.Open(house);
    first.Drive(house, first.left());
    second.Open(house);
    second.Drive(house, 200);
    ASSERT_NO_FATAL_FAILURE(wait_joined(house));
    second.Drive(house, 5);
    ASSERT_TRUE(second.LastPose(house).localized);
    ASSERT_TRUE(Enable(house, 1).status.ok());
    second.Drive(house, 5);
    ASSERT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);
  }
  StoredServer server(directory.path(), JoiningOptions(true));
  WholeServer& house = server.house();
  second.SayStarted(house);
  second.Drive(house, 100);
  third.Open(house);
  third.Drive(house, third.left() - 10);
  ASSERT_NO_FATAL_FAILURE(wait_joined(house));
  third.Drive(house, 5);
  EXPECT_TRUE(third.LastPose(house).localized);
  second.Drive(house, 5);
  EXPECT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);

  Request smooth = About(RequestKind::kJobSubmit);
  smooth.enable = true;
  const Reply submitted = house.Ask(smooth);
  ASSERT_EQ(submitted.jobs.size(), 1U) << submitted.status.message;
  const Job job = house.WaitJob(submitted.jobs[0].id);
  ASSERT_EQ(job.state, JobState::kSucceeded) << job.message;
  second.Drive(house, 5);
  EXPECT_TRUE(second.LastPose(house).localized) << job.message;
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
