// The memory may end at any moment while a session is opened: the server goes on, nothing half open is left, and the
// robot's next request is served. Every allocation of the thread that opens the session fails once, but for the small
// ones: Asio does not survive that of a strand's mutex (40 bytes).
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "tests/server/robots/roster_fixture.h"

namespace {

thread_local long allocations_left = -1;  // Below 0: all succeed.
constexpr std::size_t kSmall = 64;

}  // namespace

void* operator new(std::size_t size) {
  if (size > kSmall && allocations_left == 0) {
    allocations_left = -1;  // What is needed to say so succeeds.
    throw std::bad_alloc();
  }
  if (size > kSmall && allocations_left > 0) --allocations_left;
  if (void* const memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
// Not inlined: gcc then sees `free` beside `new` and takes it for a mistake.
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

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
    allocations_left = fails_at;
    roster().Take(request);
    failed = allocations_left < 0;
    allocations_left = -1;
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
