#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/options/config.h"
#include "tests/common/options/sample_options.h"

namespace cairn {
namespace {

struct BadConfig {
  const char* name;
  const char* text;
  const char* message;
};

class ConfigError : public testing::TestWithParam<BadConfig> {};

TEST_P(ConfigError, NamesSourceLineKeyAndWhatIsAllowed) {
  SampleOptions options;
  const auto result = ApplyYaml(GetParam().text, "c.yaml", VisitorOf(options));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, StatusCode::kInvalidArgument);
  EXPECT_THAT(result.error().message, testing::StartsWith(GetParam().message));
  EXPECT_EQ(options, SampleOptions{}) << "an error must change nothing";
}

INSTANTIATE_TEST_SUITE_P(
    Texts, ConfigError,
    testing::Values(
        BadConfig{"OutOfRange", "enabled: false\nslam:\n  length_m: 99\n",
                  "c.yaml:3: slam.length_m: '99' is out of range (allowed: 0.01..10 m)"},
        BadConfig{"NotANumber", "slam:\n  length_m: long\n",
                  "c.yaml:2: slam.length_m: 'long' is not a number (allowed: 0.01..10 m)"},
        BadConfig{"HalfANumber", "slam:\n  length_m: 1.5m\n", "c.yaml:2: slam.length_m: '1.5m' is not a number"},
        BadConfig{"Nan", "slam:\n  length_m: nan\n", "c.yaml:2: slam.length_m: 'nan' is out of range"},
        BadConfig{"Fraction", "slam:\n  particles: 2.5\n",
                  "c.yaml:2: slam.particles: '2.5' is not a whole number (allowed: 1..10000)"},
        BadConfig{"BeyondInt64", "slam:\n  particles: 99999999999999999999\n",
                  "c.yaml:2: slam.particles: '99999999999999999999' is not a whole number"},
        BadConfig{"Flag", "enabled: 1\n", "c.yaml:1: enabled: '1' is not a truth value (allowed: true or false)"},
        BadConfig{"Choice", "slam: {model: slow}\n",
                  "c.yaml:1: slam.model: 'slow' is not a choice (allowed: fast or exact)"},
        BadConfig{"Misspelt", "slam:\n  partciles: 5\n",
                  "c.yaml:2: slam.partciles: unknown key (did you mean slam.particles?)"},
        BadConfig{"WrongSection", "particles: 5\n", "c.yaml:1: particles: unknown key (did you mean slam.particles?)"},
        BadConfig{"NothingLikeIt", "zzzzzzzzzzzz: 5\n", "c.yaml:1: zzzzzzzzzzzz: unknown key"},
        BadConfig{"SectionAsValue", "slam: 5\n", "c.yaml:1: slam: is a section, not a single value"},
        BadConfig{"ValueAsSection", "enabled: {a: 1}\n", "c.yaml:1: enabled.a: unknown key"},
        BadConfig{"List", "slam: [1, 2]\n", "c.yaml:1: slam: lists are not used here"},
        BadConfig{"Twice", "enabled: true\nenabled: false\n", "c.yaml:2: enabled: given twice"},
        BadConfig{"NoNumber", "slam:\n  particles:\n  length_m: 1\n",
                  "c.yaml:2: slam.particles: has no value (allowed: 1..10000)"},
        BadConfig{"NoFlag", "enabled:\n", "c.yaml:1: enabled: has no value (allowed: true or false)"},
        BadConfig{"NoChoice", "slam: {model: }\n", "c.yaml:1: slam.model: has no value (allowed: fast or exact)"},
        BadConfig{"NoText", "\nname:  # commented\n",
                  "c.yaml:2: name: has no value (allowed: a text; an empty one is \"\")"},
        BadConfig{"Null", "slam:\n  length_m: null\n", "c.yaml:2: slam.length_m: has no value (allowed: 0.01..10 m)"},
        BadConfig{"EmptyMap", "slam:\n  particles: {}\n", "c.yaml:2: slam.particles: has no value"},
        BadConfig{"UnknownAlone", "slam:\n  partciles:\n",
                  "c.yaml:2: slam.partciles: unknown key (did you mean slam.particles?)"},
        BadConfig{"AloneAndGiven", "enabled:\nenabled: true\n", "c.yaml:2: enabled: given twice"},
        BadConfig{"SecondDocument", "slam:\n  particles: 5\n---\nslam:\n  particles: 6\n",
                  "c.yaml:3: a second document; all keys belong into one"},
        BadConfig{"StrayComma", "\n, a\n", "c.yaml:2: a second document"},
        BadConfig{"NotYaml", "slam: [1, 2\nname: }\n", "c.yaml:"},
        BadConfig{"JustAWord", "hello\n", "c.yaml:1: not a tree"},
        BadConfig{"AliasCircle", "slam: &a\n  inner: *a\n", "c.yaml:"}),
    [](const auto& fault) { return std::string(fault.param.name); });

TEST(ConfigError, TheFirstErrorInTheFileIsNamed) {
  SampleOptions options;
  const auto result = ApplyYaml("zebra: 1\nenabled: maybe\n", "c.yaml", VisitorOf(options));
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, testing::HasSubstr("zebra"));
}

TEST(ConfigError, ExponentialAliasesEnd) {
  std::string text = "a0: &a0 [x, x]\n";
  text = "a0: &a0 {k: 1, l: 2}\n";
  for (int i = 1; i < 30; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    text += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " {k: " + before + ", l: " + before + "}\n";
  }
  SampleOptions options;
  EXPECT_FALSE(ApplyYaml(text, "c.yaml", VisitorOf(options)));
}

TEST(ConfigError, SetSaysWhatItWants) {
  SampleOptions options;
  for (const auto& [assignment, message] : std::vector<std::pair<std::string, std::string>>{
           {"slam.particles", "--set: 'slam.particles' is not key=value"},
           {"=5", "--set: '=5' is not key=value"},
           {"slam.particles=0", "--set: slam.particles: '0' is out of range (allowed: 1..10000)"},
           {"slam.particle=1", "--set: slam.particle: unknown key (did you mean slam.particles?)"}}) {
    const auto result = ApplySet({assignment}, VisitorOf(options));
    ASSERT_FALSE(result) << assignment;
    EXPECT_EQ(result.error().message, message);
  }
  EXPECT_EQ(options, SampleOptions{});
}

}  // namespace
}  // namespace cairn
