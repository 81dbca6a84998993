#include "server/ops/end_when_stuck.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

using std::chrono::seconds;

void Look(EndWhenStuck& end, int second, bool healthy) {
  end.Look(healthy, Heartbeat::Clock::time_point{} + seconds(second));
}

TEST(EndWhenStuckDeathTest, EndsTheProcessWithItsOwnExitCodeAfterTheLongestTime) {
  EndWhenStuck end(seconds(60));
  Look(end, 0, false);
  Look(end, 60, false);
  EXPECT_EXIT(Look(end, 61, false), testing::ExitedWithCode(4), "");
}

TEST(EndWhenStuckDeathTest, OneHealthyLookBeginsTheTimeAnew) {
  EndWhenStuck end(seconds(60));
  Look(end, 0, false);
  Look(end, 59, true);
  Look(end, 61, false);
  Look(end, 119, false);
  EXPECT_EXIT(Look(end, 122, false), testing::ExitedWithCode(4), "");
}

}  // namespace
}  // namespace cairn::server
