// A robot whose start is compared with what another one has drawn.
#pragma once

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <optional>
#include <string>

#include "server/jobs/start_check.h"
#include "tests/eventually.h"
#include "tests/server/robots/roster_fixture.h"

namespace cairn::server {

using testing::RequestOf;
using testing::RoomOdometry;
using testing::RoomScan;

// A robot that has drawn the room, and another one in it, which is said to start somewhere.
class StartCheckTest : public testing::RosterTest {
 protected:
  static constexpr int kStepsPerMetre = 21;

  StartCheckTest() {
    roster().Take(RequestOf("r1", 7));
    Drive("r1", 7, 0, 120);
  }

  void Open(const Pose2& said) {
    SessionRequest request = RequestOf("r2", 8);
    request.has_start = true;
    request.T_map_robot_start = said;
    roster().Take(request);
  }
  void Drive(const std::string& robot, ClientId client, int first, int last) {
    for (int step = first; step < last; ++step) {
      roster().Take(testing::OdometryOf(robot, RoomOdometry(step), client));
      roster().Take(testing::ScanOf(robot, RoomScan(step), client));
      // The queue takes a limited number.
      if (step % 16 == 15 || step + 1 == last) AwaitUsed(robot, static_cast<std::uint64_t>(step) + 1);
    }
  }
  // Drives on until 5 m from its start, and returns after how many metres its start was refused.
  std::optional<int> RefusedAfter(StartCheck& check, int first_metre = 1) {
    for (int metre = first_metre; metre <= 5; ++metre) {
      Drive("r2", 8, (metre - 1) * kStepsPerMetre, metre * kStepsPerMetre);
      check.Tick();
      check.Tick();  // Nothing is due.
      AwaitSite();
      AwaitStrand();
      if (Joining().fragment) return metre;
    }
    return std::nullopt;
  }
  void ExpectRefused(const Pose2& wrong) {
    Open(wrong);
    StartCheck check(options_, roster(), *atlas_);
    const auto metres = RefusedAfter(check);
    ASSERT_TRUE(metres);
    EXPECT_GE(*metres, 2) << "one contradiction may be a coincidence";
    const SessionState state = roster().Find("r2")->record().state();
    EXPECT_EQ(state.phase, SessionPhase::kActive);
    EXPECT_EQ(state.status.code, StatusCode::kFailedPrecondition);
    EXPECT_NE(state.status.message.find("contradicts the map"), std::string::npos);
    Drive("r2", 8, *metres * kStepsPerMetre, *metres * kStepsPerMetre + 1);
    EXPECT_EQ(roster().Find("r2")->record().snapshot().status.pose.reason, PoseReason::kNotJoined);
  }
  SessionRecord::Joining Joining() { return roster().Find("r2")->record().joining(); }
  void AwaitUsed(const std::string& robot, std::uint64_t scans) {
    ASSERT_TRUE(test::Eventually(
        [&] { return roster().Find(robot)->record().snapshot().status.ledgers.at(0).settled_through >= scans; }));
  }
  void AwaitSite() {
    std::promise<void> done;
    atlas_->Find("lab")->Probe([&done] { done.set_value(); });
    done.get_future().wait();
  }
  void AwaitStrand() {
    std::promise<void> done;
    ASSERT_TRUE(roster().Find("r2")->Post(SnapshotWanted{[&done](SessionMaterial&&) { done.set_value(); }}));
    done.get_future().wait();
  }

  JobsOptions options_;
};

}  // namespace cairn::server
