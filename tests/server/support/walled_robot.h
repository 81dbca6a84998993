// Robots that drive through worlds of walls on a whole server that joins them, for tests of joining.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/slam/worlds.h"
#include "tests/server/support/stored_server.h"

namespace cairn::server::testing {

inline constexpr ClientId kOther = 8;

inline ServerOptions JoiningOptions(bool join) {
  ServerOptions options = TestOptions();
  options.jobs.join = join;
  options.jobs.join_way_m = 15.0;
  options.robots.checkpoint_entries = 50;  // So that a restart begins with one.
  return options;
}

// Its odometry begins at the origin where it starts, and turns a little too far with every metre.
class WalledRobot {
 public:
  // The world must outlive the robot.
  WalledRobot(std::string name, ClientId client, const slam::test::World& world, const slam::test::Laser& laser,
              const Pose2& T_world_start, std::vector<Pose2> steps)
      : name_(std::move(name)),
        client_(client),
        world_(world),
        laser_(laser),
        engine_(client),
        steps_(std::move(steps)),
        T_world_robot_(T_world_start) {}

  void Open(WholeServer& house) const { house.Open(name_, client_, "lab", std::nullopt); }
  void SayStarted(WholeServer& house) const { testing::SayStarted(house, name_, client_); }
  void Drive(WholeServer& house, std::size_t count) {
    for (; count > 0 && next_ < steps_.size(); --count, ++next_) {
      const Pose2& step = steps_[next_];
      T_world_robot_ = T_world_robot_ * step;
      T_odom_robot_ = T_odom_robot_ * step * Pose2{0.0, 0.0, 0.0002 * step.translation().norm()};
      Scan scan = slam::test::Look(world_, T_world_robot_, laser_, &engine_);
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
  // The distance between a pose of the last step and the truth, in the frame of a robot that began at the origin.
  [[nodiscard]] double Error(const PoseReport& pose) const {
    return (pose.T_map_robot.translation() - T_world_robot_.translation()).norm();
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

  const std::string name_;
  const ClientId client_;
  const slam::test::World& world_;
  const slam::test::Laser laser_;
  std::mt19937_64 engine_;
  std::vector<Pose2> steps_;
  std::size_t next_ = 0;
  std::uint64_t sequence_ = 0;
  Pose2 T_world_robot_, T_odom_robot_;
};

inline MapInfo InfoOf(WholeServer& house) {
  const Reply reply = house.Ask(About(RequestKind::kMapInfo));
  return reply.maps.empty() ? MapInfo{} : reply.maps[0];
}

// The last of the jobs that have joined robots, or fitted them to each other; nothing: there is none.
inline std::optional<Job> JoinedBy(const WholeServer& house) {
  std::optional<Job> last;
  for (const Job& job : house.All<Job>()) {
    if (job.kind == JobKind::kJoin && job.state == JobState::kSucceeded && job.map_version > 0) last = job;
  }
  return last;
}

}  // namespace cairn::server::testing
