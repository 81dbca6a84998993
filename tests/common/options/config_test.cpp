#include "common/options/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/common/options/sample_options.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

TEST(Config, FillsEveryKindOfField) {
  SampleOptions options;
  const auto result = ApplyYaml(
      "slam:\n  length_m: 2.5\n  particles: 30\n  model: exact\n  inner: {inner_rad: -1e-3}\nenabled: false\n"
      "name: \"true\"\n",
      "test.yaml", VisitorOf(options));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(options, (SampleOptions{2.5, 30, false, "true", SampleModel::kExact, -1e-3}));
}

TEST(Config, MissingKeysKeepTheirDefaults) {
  SampleOptions options;
  ASSERT_TRUE(ApplyYaml("slam:\n  particles: 7\n", "test.yaml", VisitorOf(options)));
  SampleOptions expected;
  expected.particles = 7;
  EXPECT_EQ(options, expected);
}

TEST(Config, EmptyTextAndEmptySectionsChangeNothing) {
  for (const char* text : {"", "# only a comment\n", "slam:\n", "slam: {}\n", "slam:\n  inner:\n", "---\n",
                           "---\nslam:\n  # particles: 5\n...\n"}) {
    SampleOptions options;
    const auto result = ApplyYaml(text, "test.yaml", VisitorOf(options));
    EXPECT_TRUE(result) << text << ": " << result.error().message;
    EXPECT_EQ(options, SampleOptions{});
  }
}

TEST(Config, SetOverridesByFullKey) {
  SampleOptions options;
  const auto result =
      ApplySet({"slam.particles=5", "name=a=b", "slam.inner.inner_rad=0.5", "slam.particles=6"}, VisitorOf(options));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(options.particles, 6);  // The later one wins.
  EXPECT_EQ(options.name, "a=b");
  EXPECT_EQ(options.inner_rad, 0.5);
}

TEST(Config, BoundsThemselvesAreAllowed) {
  SampleOptions options;
  EXPECT_TRUE(ApplySet({"slam.length_m=0.01"}, VisitorOf(options)));
  EXPECT_TRUE(ApplySet({"slam.length_m=10", "slam.particles=10000"}, VisitorOf(options)));
}

TEST(Config, PrintedOptionsReadBackExactly) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> angle(-4.0, 4.0), length(0.01, 10.0);
  for (int i = 0; i < 200; ++i) {
    SampleOptions options;
    options.inner_rad = i == 0 ? 5e-324 : angle(random);
    options.length_m = length(random);
    options.model = i % 2 == 0 ? SampleModel::kFast : SampleModel::kExact;
    options.enabled = i % 3 == 0;
    options.name = i % 2 == 0 ? "tab\t \"quoted\" \\ # : \n\x01 Grüße" : "null";
    const std::string text = PrintYaml(VisitorOf(options));
    SampleOptions read;
    const auto result = ApplyYaml(text, "printed", VisitorOf(read));
    ASSERT_TRUE(result) << result.error().message << "\n" << text;
    EXPECT_EQ(read, options) << text;
  }
}

TEST(Config, PrintsMeaningUnitAndRange) {
  SampleOptions options;
  EXPECT_EQ(PrintYaml(VisitorOf(options)),
            "slam:  # the estimator\n"
            "  # how long\n"
            "  length_m: 0.1  # [0.01..10 m]\n"
            "  # how many\n"
            "  particles: 200  # [1..10000]\n"
            "  inner:\n"
            "    # turn\n"
            "    inner_rad: 0.3333333333333333  # [-4..4 rad]\n"
            "  # which\n"
            "  model: fast  # [fast or exact]\n"
            "# whether\n"
            "enabled: true\n"
            "# what it is called\n"
            "name: \"floor\"\n");
}

TEST(Config, ReadsAFile) {
  const TempDirectory directory;
  SampleOptions options;
  ASSERT_TRUE(ApplyYamlFile(directory.Write("c.yaml", "enabled: false\n"), VisitorOf(options)));
  EXPECT_FALSE(options.enabled);
  const auto missing = ApplyYamlFile(directory / "none.yaml", VisitorOf(options));
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, StatusCode::kNotFound);
}

}  // namespace
}  // namespace cairn
