// The memory ends while a start is compared with the map: the next comparison takes place all the same.
#include "tests/server/jobs/start_check_fixture.h"
#include "tests/server/support/failing_memory.h"

namespace cairn::server {
namespace {

TEST_F(StartCheckTest, AComparisonThatFailsIsNotTheLastOne) {
  Open({2.0, 1.5, 0.0});
  StartCheck check(options_, roster(), *atlas_);
  check.Tick();  // Compares the other robot, which does not move any more.
  Drive("r2", 8, 0, 2 * kStepsPerMetre);
  AwaitStrand();
  AwaitSite();
  // What is asked of the site while it is busy is done together afterwards, on one thread.
  std::promise<void> busy, released;
  bool failed = false;
  const auto site = atlas_->Find("lab");
  site->Probe([&] {
    busy.set_value();
    released.get_future().wait();
  });
  busy.get_future().wait();
  site->Probe([] { test::allocations_left = 0; });
  check.Tick();
  site->Probe([&failed] {
    failed = test::allocations_left < 0;
    test::allocations_left = -1;
  });
  released.set_value();
  AwaitSite();
  ASSERT_TRUE(failed);
  EXPECT_TRUE(RefusedAfter(check, 3));
}

}  // namespace
}  // namespace cairn::server
