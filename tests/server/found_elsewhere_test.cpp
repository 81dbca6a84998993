// A robot that somebody has carried to where others have mapped, and a robot that is not joined with the map and of
// which somebody says where it is, through the whole server.
#include <gmock/gmock.h>

#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/slam/ring_world.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

using ::testing::HasSubstr;

constexpr ClientId kSecond = 8;

// A robot on the ring of corridors; the origin of the map is the ring's beginning. Its odometry begins at zero.
class Carried {
 public:
  Carried(std::string name, ClientId client, double from_m) : name_(std::move(name)), client_(client), engine_(client) {
    PutAt(from_m);
  }

  // Somebody carries it there; its odometry does not notice.
  void PutAt(double from_m) {
    T_ring_robot_ = {};
    const std::vector<Pose2> before = slam::test::RingSteps(from_m, kStepM);
    for (const Pose2& step : before) T_ring_robot_ = T_ring_robot_ * step;
    next_ = before.size();
  }
  void Open(WholeServer& house, bool says_where) const {
    house.Open(name_, client_, "lab", says_where ? std::optional(T_ring_robot_) : std::nullopt);
  }
  void Drive(WholeServer& house, double metres) {
    static const slam::test::World world = slam::test::RingCorridor(true);
    static const std::vector<Pose2> steps = slam::test::RingSteps(110.0, kStepM);
    const slam::test::Laser laser{.first_rad = -kPi / 2, .range_max_m = 12.0, .sigma_m = 0.01};
    for (double way_m = 0.0; way_m < metres && next_ < steps.size(); ++next_) {
      const Pose2& step = steps[next_];
      way_m += step.translation().norm();
      T_ring_robot_ = T_ring_robot_ * step;
      T_odom_robot_ = T_odom_robot_ * step;
      Scan scan = slam::test::Look(world, T_ring_robot_, laser, &engine_);
      scan.sequence = ++sequence_;
      scan.stamp = static_cast<Stamp>(sequence_) * 200'000'000;
      house.SendOdometry(name_, client_, {sequence_, scan.stamp, T_odom_robot_});
      house.SendScan(name_, client_, std::move(scan));
      if (sequence_ % 16 == 0) house.WaitSettled(name_, sequence_ - 1);
    }
    house.WaitSettled(name_, sequence_ - 1);  // The last scan waits for the odometry after it.
  }
  [[nodiscard]] PoseReport LastPose(const WholeServer& house) const {
    PoseReport last;
    for (const PoseReport& pose : house.All<PoseReport>()) {
      if (pose.robot == name_) last = pose;
    }
    return last;
  }
  // The last pose may be that of the step before.
  [[nodiscard]] double ErrorM(const WholeServer& house) const {
    return (LastPose(house).T_map_robot.translation() - T_ring_robot_.translation()).norm();
  }
  [[nodiscard]] const Pose2& T_ring_robot() const { return T_ring_robot_; }
  [[nodiscard]] std::uint64_t sent() const { return sequence_; }

 private:
  static constexpr double kStepM = 0.2;

  const std::string name_;
  const ClientId client_;
  std::mt19937_64 engine_;
  std::size_t next_ = 0;
  std::uint64_t sequence_ = 0;
  Pose2 T_ring_robot_, T_odom_robot_;
};

ServerOptions Options() {
  ServerOptions options = TestOptions();
  options.jobs.join = false;
  options.jobs.relocalise_after_s = 0.0;  // Only when the test asks.
  options.robots.checkpoint_entries = 20;
  return options;
}

Reply Relocalise(WholeServer& house, const std::string& robot, const std::optional<Pose2>& T_map_robot = {}) {
  Request request = About(RequestKind::kRelocalise, robot);
  request.T_map_robot = T_map_robot;
  return house.Ask(request);
}

// The map is published as it was drawn until now.
void WaitPublished(WholeServer& house, const Pose2& T_map_robot) {
  const TileKey key{0, FloorDiv(static_cast<int>(std::floor(T_map_robot.x / 0.05)), kTileCells),
                    FloorDiv(static_cast<int>(std::floor(T_map_robot.y / 0.05)), kTileCells)};
  ASSERT_TRUE(house.WaitFor([&] { return house.CurrentTiles().contains(key); }));
}

TEST(FoundElsewhere, ARobotThatWasCarriedToThePartOfAnotherIsFoundThereAndARestartKnowsIt) {
  const TempDirectory directory;
  Trajectory path;
  {
    StoredServer server(directory / "0", Options());
    WholeServer& house = server.house();
    Carried first("r1", kDriver, 0.0), second("r2", kSecond, 44.0);
    first.Open(house, true);
    first.Drive(house, 16.0);
    second.Open(house, true);
    second.Drive(house, 40.0);
    ASSERT_TRUE(second.LastPose(house).localized);
    ASSERT_NO_FATAL_FAILURE(WaitPublished(house, second.T_ring_robot()));

    first.PutAt(52.0);
    const Reply lost = Relocalise(house, "r1");
    ASSERT_TRUE(lost.status.ok()) << lost.status.message;
    ASSERT_EQ(lost.jobs.size(), 1U);
    EXPECT_EQ(lost.jobs[0].kind, JobKind::kRelocalise);
    EXPECT_EQ(lost.jobs[0].robot, "r1");
    first.Drive(house, 10.0);
    EXPECT_TRUE(IsFinal(house.WaitJob(lost.jobs[0].id).state));
    if (!first.LastPose(house).localized) {
      // It stays lost as it was, and what it has seen since counts.
      const Reply again = Relocalise(house, "r1");
      ASSERT_EQ(again.jobs.size(), 1U) << again.status.message;
      const Job job = house.WaitJob(again.jobs[0].id);
      EXPECT_EQ(job.state, JobState::kSucceeded) << job.message;
      EXPECT_THAT(job.message, HasSubstr("have to confirm"));
      ASSERT_FALSE(job.places.empty());
      EXPECT_LT((job.places[0].T_map_robot.translation() - first.T_ring_robot().translation()).norm(), 1.0);
      EXPECT_FALSE(first.LastPose(house).localized) << "a job alone is no proof";
      EXPECT_FALSE(house.Ask(About(RequestKind::kPose)).hypotheses.empty());
      first.Drive(house, 4.0);
    }
    EXPECT_TRUE(first.LastPose(house).localized) << PoseReasonName(first.LastPose(house).reason);
    EXPECT_LT(first.ErrorM(house), 0.5);
    ASSERT_TRUE(house.WaitFor([&] { return DurableScans(house) == first.sent(); }));
    path = PathOf(house);
    CopyState(directory / "0", directory / "1");
  }
  StoredServer second(directory / "1", Options());
  EXPECT_TRUE(SamePath(PathOf(second.house()), path));
}

// Its own map does not show the place.
TEST(FoundElsewhere, ARobotThatWasCarriedToThePartOfAnotherIsFoundWhereSomebodySays) {
  WholeServer house(Options());
  Carried first("r1", kDriver, 0.0), second("r2", kSecond, 44.0);
  first.Open(house, true);
  first.Drive(house, 16.0);
  second.Open(house, true);
  second.Drive(house, 40.0);
  ASSERT_NO_FATAL_FAILURE(WaitPublished(house, second.T_ring_robot()));

  first.PutAt(52.0);
  const Reply told = Relocalise(house, "r1", first.T_ring_robot() * Pose2{0.4, -0.2, 0.1});
  ASSERT_TRUE(told.status.ok()) << told.status.message;
  ASSERT_EQ(told.jobs.size(), 1U);
  first.Drive(house, 2.0);
  const Job job = house.WaitJob(told.jobs[0].id);
  EXPECT_EQ(job.state, JobState::kSucceeded) << job.message;
  EXPECT_THAT(job.message, HasSubstr("where somebody said"));
  EXPECT_THAT(job.message, HasSubstr("have to confirm"));
  first.Drive(house, 4.0);
  EXPECT_TRUE(first.LastPose(house).localized) << PoseReasonName(first.LastPose(house).reason);
  EXPECT_LT(first.ErrorM(house), 0.5);
}

TEST(FoundElsewhere, ARobotThatIsNotJoinedIsJoinedWhereSomebodySaysAndOnlyIfThatIsRight) {
  WholeServer house(Options());
  Carried first("r1", kDriver, 0.0), second("r2", kSecond, 20.0);
  first.Open(house, true);
  first.Drive(house, 50.0);
  ASSERT_NO_FATAL_FAILURE(WaitPublished(house, first.T_ring_robot()));
  second.Open(house, false);
  second.Drive(house, 14.0);
  ASSERT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);

  const Reply wrong = Relocalise(house, "r2", second.T_ring_robot() * Pose2{0.0, 0.0, kPi});
  ASSERT_EQ(wrong.jobs.size(), 1U) << wrong.status.message;
  const Job refused = house.WaitJob(wrong.jobs[0].id);
  EXPECT_EQ(refused.state, JobState::kFailed);
  EXPECT_THAT(refused.message, HasSubstr("nothing was changed"));
  second.Drive(house, 0.4);
  EXPECT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);
  EXPECT_EQ(house.Ask(About(RequestKind::kMapInfo)).maps.at(0).enabled_version, 1U);

  const Reply right = Relocalise(house, "r2", second.T_ring_robot() * Pose2{0.3, 0.1, 0.1});
  ASSERT_EQ(right.jobs.size(), 1U) << right.status.message;
  const Job joined = house.WaitJob(right.jobs[0].id);
  EXPECT_EQ(joined.state, JobState::kSucceeded) << joined.message;
  EXPECT_EQ(joined.map_version, 2U);
  second.Drive(house, 1.0);
  EXPECT_TRUE(second.LastPose(house).localized) << PoseReasonName(second.LastPose(house).reason);
  EXPECT_LT(second.ErrorM(house), 0.5);
  // It can be taken back.
  Request back = About(RequestKind::kMapEnable);
  back.map_version = 1;
  ASSERT_TRUE(house.Ask(back).status.ok());
  second.Drive(house, 1.0);
  EXPECT_EQ(second.LastPose(house).reason, PoseReason::kNotJoined);
}

}  // namespace
}  // namespace cairn::server::testing
