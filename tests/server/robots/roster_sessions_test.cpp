// Which sessions a roster knows, and when it gives their keys back.
#include <gmock/gmock.h>

#include <type_traits>
#include <variant>
#include <vector>

#include "tests/server/robots/roster_fixture.h"

namespace cairn::server {
namespace {

using ::testing::HasSubstr;
using testing::RequestOf;
using testing::RosterTest;

// After a restart of the server, robots were put where they had once begun.
TEST_F(RosterTest, ASessionThatWasStartedElsewhereIsNotOpenedAtItsOldStart) {
  SessionRequest started = RequestOf("r1", 7);
  started.started = true;
  roster().Take(started);
  EXPECT_EQ(roster().Find("r1"), nullptr);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kRefused);
  EXPECT_EQ(LastState("r1", 7).status.code, StatusCode::kFailedPrecondition);
  EXPECT_THAT(LastState("r1", 7).status.message, HasSubstr("does not know this session"));
  started.session = 70;
  started.started = false;
  roster().Take(started);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
  EXPECT_EQ(LastState("r1", 7).session, 70U);
  started.started = true;  // Known here.
  roster().Take(started);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
}

TEST_F(RosterTest, AnotherProcessMayContinueASessionThatItKnows) {
  roster().Take(RequestOf("r1", 7));
  Suspend(7);
  SessionRequest same = RequestOf("r1", 8);
  same.session = 7;
  same.started = true;
  roster().Take(same);
  EXPECT_EQ(LastState("r1", 8).phase, SessionPhase::kActive);
  EXPECT_EQ(roster().Find("r1")->record().owner(), 8U);
}

TEST_F(RosterTest, TheKeysOfASessionThatIsGoneAreGivenBack) {
  RobotsOptions options;
  options.max_robots = 1;
  roster(options).Take(RequestOf("r1", 7));
  ASSERT_TRUE(roster().End("r1"));
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  roster().Take(RequestOf("r2", 8));
  std::vector<std::size_t> kinds;
  ASSERT_TRUE(sent_.WaitFor([&] {
    roster().Tick();
    return sent().All<Retired>().size() >= 4;
  }));
  for (const Retired& retired : sent().All<Retired>()) {
    kinds.push_back(retired.of.index());
    std::visit(
        [](const auto& of) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(of)>, Job>) {
            EXPECT_EQ(of.robot_id, HashName("r1"));
          }
        },
        retired.of);
  }
  EXPECT_THAT(kinds, ::testing::UnorderedElementsAre(0, 1, 2, 2));  // State, pose, the ledgers of laser and odometry.
  roster().Tick();
  EXPECT_EQ(sent().All<Retired>().size(), 4U);
}

}  // namespace
}  // namespace cairn::server
