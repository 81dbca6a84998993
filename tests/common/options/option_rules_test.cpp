#include <gtest/gtest.h>

#include "common/options/config.h"

namespace cairn {
namespace {

struct Fence {
  double low_m = 1.0;
  double high_m = 2.0;
  bool open = false;
};

VisitOptions VisitorOf(Fence& fence) {
  return [&fence](OptionVisitor& visitor) {
    visitor.Section("garden", "", [&] {
      visitor.Section("fence", "", [&] {
        visitor.Real("low_m", fence.low_m, "m", 0.0, 10.0, "");
        visitor.Real("high_m", fence.high_m, "m", 0.0, 10.0, "");
      });
      visitor.Flag("open", fence.open, "");
      visitor.Require(fence.low_m <= fence.high_m, "fence.low_m", "must not exceed", "fence.high_m");
      visitor.Require(!fence.open || fence.high_m <= 2.0, "open", "needs a lower", "fence.high_m");
    });
  };
}

TEST(OptionRules, ABrokenOneNamesBothKeysAndTheirValues) {
  Fence fence;
  EXPECT_TRUE(CheckRules(VisitorOf(fence)));
  fence.low_m = 2.5;
  const auto result = CheckRules(VisitorOf(fence));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(result.error().message, "garden.fence.low_m (2.5) must not exceed garden.fence.high_m (2)");
}

TEST(OptionRules, TheFirstBrokenOneIsNamed) {
  Fence both{5.0, 4.0, true}, second{3.0, 4.0, true};
  EXPECT_EQ(CheckRules(VisitorOf(both)).error().message,
            "garden.fence.low_m (5) must not exceed garden.fence.high_m (4)");
  EXPECT_EQ(CheckRules(VisitorOf(second)).error().message, "garden.open (true) needs a lower garden.fence.high_m (4)");
}

// While a file is read, rules do not count: a later --set may mend what it breaks.
TEST(OptionRules, AreNotAskedWhileValuesAreAssigned) {
  Fence fence;
  ASSERT_TRUE(ApplySet({"garden.fence.low_m=3"}, VisitorOf(fence)));
  EXPECT_FALSE(CheckRules(VisitorOf(fence)));
  ASSERT_TRUE(ApplySet({"garden.fence.high_m=4"}, VisitorOf(fence)));
  EXPECT_TRUE(CheckRules(VisitorOf(fence)));
}

// A misspelt key in a rule shows in every start, not only in the one that breaks the rule.
TEST(OptionRules, ARuleAboutAKeyThatIsNotThereNeverHolds) {
  Fence fence;
  const auto result = CheckRules([&](OptionVisitor& visitor) {
    visitor.Real("low_m", fence.low_m, "m", 0.0, 10.0, "");
    visitor.Require(true, "low_m", "must not exceed", "hihg_m");
  });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "a rule names a key that no field before it has: hihg_m");
}

}  // namespace
}  // namespace cairn
