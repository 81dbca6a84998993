// The memory may end while a site is told something: it goes on, and shows what comes later. Every allocation fails
// once.
#include <gtest/gtest.h>

#include <future>

#include "tests/eventually.h"
#include "tests/server/maps/site_sessions.h"
#include "tests/server/support/failing_memory.h"

namespace cairn::server {
namespace {

using namespace testing;

TEST_F(SiteTest, WhicheverAllocationFailsLaterChangesAreShownAndNothingSeemsToBeUnderWay) {
  int failures = 0;
  bool failed = true;
  for (int fails_at = 0; failed; ++fails_at) {
    ASSERT_LT(fails_at, 100);
    // The strand is busy meanwhile. Asio does not survive it if a strand cannot be woken up.
    std::promise<void> released;
    site_->Probe([&] { released.get_future().wait(); });
    GridChange lost{.session = 1, .chunks = {{{fails_at, 0}, UniformChunk(100)}}};
    failed = test::FailsAtAllocation(fails_at, [&] { site_->Change(std::move(lost)); });
    failed = test::FailsAtAllocation(fails_at, [&] { site_->Publish(); }) || failed;
    failures += failed ? 1 : 0;
    released.set_value();
    Settle();
    site_->Change({.session = 2, .chunks = {{{fails_at, 1}, UniformChunk(100)}}});
    TakeTiles();
    EXPECT_NE(site_->snapshot()->tiles.Find({0, fails_at, 1}), nullptr) << "allocation " << fails_at;
    EXPECT_TRUE(test::Eventually([&] { return !site_->pulse().busy; })) << "allocation " << fails_at;
  }
  EXPECT_GE(failures, 2);
}

}  // namespace
}  // namespace cairn::server
