// The memory may end at any moment while a session is opened: the server goes on, nothing half open is left, and the
// robot's next request is served. Every allocation of the thread that opens the session fails once, but for the small
// ones (failing_memory.h).
#include <gtest/gtest.h>

#include <new>

#include "tests/server/robots/roster_fixture.h"
#include "tests/server/support/failing_memory.h"

namespace cairn::server {
namespace {

using testing::RequestOf;
using testing::RosterTest;

TEST_F(RosterTest, WhicheverAllocationFailsTheNextRequestOpensTheSession) {
  RobotsOptions options;
  options.max_robots = 1;  // Each session takes the place of the one before.
  options.place_kept_s = 0.0;
  roster(options).Take(RequestOf("r0", 7));
  ASSERT_NE(roster().Find("r0"), nullptr);
  int refused = 0;
  long fails_at = 0;
  for (bool failed = true; failed; ++fails_at) {
    ASSERT_LT(fails_at, 100'000);
    const std::string robot = "r" + std::to_string(fails_at + 1);
    const ClientId client = 100 + static_cast<ClientId>(fails_at);
    const SessionRequest request = RequestOf(robot, client);
    Suspend(roster().All().front()->record().owner());
    failed = test::FailsAtAllocation(fails_at, [&] { roster().Take(request); });
    const bool told = LastState(robot, client).status.code == StatusCode::kUnavailable;
    refused += told ? 1 : 0;
    EXPECT_TRUE(!told || roster().Find(robot) == nullptr) << "allocation " << fails_at << ": half open";
    roster().Take(request);
    ASSERT_EQ(LastState(robot, client).phase, SessionPhase::kActive) << "allocation " << fails_at;
    ASSERT_EQ(roster().All().size(), 1U) << "allocation " << fails_at;
    roster().Tick();
  }
  EXPECT_GT(refused, 15);
}

// The memory ended when the last one let go of the session. An exception that leaves a destructor ends the process.
TEST(Session, ThatCannotBeTakenOutOfItsSiteEndsNothing) {
  asio::thread_pool pool(1);
  int asked = 0;
  auto session = std::make_shared<Session>(
      SessionSetup{.id = 1, .request = RequestOf("r1"), .map_epoch = 1, .estimator = {}}, RobotsOptions{}, pool,
      SessionOutputs{.send = [](const OutboundValue&) { return true; },
                     .grid_changed = [](GridChange&&) {},
                     .gone =
                         [&asked] {
                           ++asked;
                           throw std::bad_alloc();
                         }});
  session.reset();
  EXPECT_EQ(asked, 1);
  pool.join();
}

}  // namespace
}  // namespace cairn::server
