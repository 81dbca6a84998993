#include "tests/server/jobs/start_check_fixture.h"

namespace cairn::server {
namespace {

TEST_F(StartCheckTest, AStartBesideTheTrueOneIsRefusedWithAReasonWithinFiveMetres) {
  ExpectRefused({2.0, 1.5, 0.0});
}

TEST_F(StartCheckTest, SoIsOneThatIsTurned) {
  ExpectRefused({0.0, 0.0, 0.6});
}

TEST_F(StartCheckTest, AStartAsExactAsAPersonSaysItIsNotRefused) {
  Open({0.25, -0.2, 0.06});
  StartCheck check(options_, roster(), *atlas_);
  EXPECT_EQ(RefusedAfter(check), std::nullopt);
  EXPECT_TRUE(roster().Find("r2")->record().snapshot().status.pose.localized);
}

TEST_F(StartCheckTest, NothingIsRefusedWhereItIsSwitchedOff) {
  options_.check_starts = false;
  Open({2.0, 1.5, 0.0});
  StartCheck check(options_, roster(), *atlas_);
  EXPECT_EQ(RefusedAfter(check), std::nullopt);
}

}  // namespace
}  // namespace cairn::server
