#include <gtest/gtest.h>

#include "common/options/config.h"
#include "tests/common/options/sample_options.h"
#include "tests/fuzz/mutation.h"

namespace cairn {
namespace {

TEST(OptionsFuzz, DamagedConfigurationsAreRefusedOrWithinRange) {
  SampleOptions defaults;
  const std::string good = PrintYaml(VisitorOf(defaults));
  std::mt19937_64 random(7);
  int accepted = 0;
  for (int i = 0; i < 5000; ++i) {
    const std::string bad = Mutate(good, random,
                                   {"nan", "inf", "expert: ", "&a ", "*a", "<<: ", "[", "]", "{", "}", "- ", ": ", "\n",
                                    "\t", "? ", "|", ">", "!!map "});
    SampleOptions options;
    const auto result = ApplyYaml(bad, "fuzz", VisitorOf(options));
    if (!result) {
      EXPECT_FALSE(result.error().message.empty());
      EXPECT_EQ(options, SampleOptions{});
      continue;
    }
    ++accepted;
    EXPECT_TRUE(options.length_m >= 0.01 && options.length_m <= 10.0);
    EXPECT_TRUE(options.particles >= 1 && options.particles <= 10000);
    EXPECT_TRUE(options.inner_rad >= -4.0 && options.inner_rad <= 4.0);
    EXPECT_TRUE(options.model == SampleModel::kFast || options.model == SampleModel::kExact);
  }
  EXPECT_GT(accepted, 100);
}

TEST(OptionsFuzz, DeepNestingEndsInAnError) {
  SampleOptions options;
  for (const std::string& piece : {std::string("["), std::string("{a: "), std::string("- ")}) {
    std::string text;
    for (int i = 0; i < 20'000; ++i) text += piece;
    EXPECT_FALSE(ApplyYaml(text, "fuzz", VisitorOf(options)));
  }
}

}  // namespace
}  // namespace cairn
