#include "tests/server/slam/moved_sweep.h"

#include <gtest/gtest.h>

namespace cairn::test {
namespace {

// The cut of the study `moved` for every day.
TEST(MovedSweep, NoRobotIsLocalizedAtAWrongPlace) {
  MovedSweepOptions options;
  options.worlds = {"office"};  // Many of its rooms look alike, and its map has drifted by 0.5 m then.
  options.moments = 1;
  options.first_s = 105.0;
  options.watched_again_s = 25.0;
  int found = 0;
  const std::vector<MovedCase> cases = RunMovedSweep(options);
  for (const MovedCase& one : cases) {
    EXPECT_EQ(one.wrong, 0) << one.world << ", " << one.kind << ", at " << one.from_s << " s";
    if (one.stood_still) {
      EXPECT_EQ(one.found_after_s, 0.0) << one.world << ", " << one.kind << ", at " << one.from_s;
    }
    found += one.found_after_s >= 0.0 ? 1 : 0;
  }
  EXPECT_EQ(cases.size(), MovedKinds().size());
  EXPECT_GE(3 * found, static_cast<int>(cases.size()));
}

// The cut of `moved --only kidnapped`. Such robots used to be noticed after 6 m (median), some only after 40 m.
TEST(MovedSweep, ARobotThatIsCarriedUnseenIsNeverLocalizedAtAWrongPlaceAndIsFound) {
  MovedSweepOptions options;
  options.worlds = {"office", "room"};
  options.moments = 1;
  options.first_s = 135.0;
  options.kidnapped = true;
  int found = 0;
  const std::vector<MovedCase> cases = RunMovedSweep(options);
  for (const MovedCase& one : cases) {
    EXPECT_EQ(one.wrong, 0) << one.world << ", " << one.kind;
    found += one.found_after_m >= 0.0 ? 1 : 0;
  }
  EXPECT_EQ(cases.size(), 8U);
  EXPECT_GE(found, 7);
}

}  // namespace
}  // namespace cairn::test
