// The keys for operators come first in what is printed; the others stand below a heading that is no part of their
// names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/options/config.h"

namespace cairn {
namespace {

struct HouseOptions {
  std::int64_t rooms = 3;
  double wall_m = 0.1;
  bool cellar = true;
  std::string name = "old";

  bool operator==(const HouseOptions&) const = default;
};

void Visit(OptionVisitor& visitor, HouseOptions& options) {
  visitor.Section("house", "The house.", [&] {
    visitor.Real("wall_m", options.wall_m, "m", 0.0, 1.0, "How thick its walls are.");
    visitor.Section("inside", "Behind the door.", [&] {
      visitor.Integer("rooms", options.rooms, "", 1, 9, ForOperators("How many rooms it has."));
      visitor.Flag("cellar", options.cellar, "Whether it has a cellar.");
    });
    visitor.Section("empty", "Nothing at all.", [] {});
  });
  visitor.Text("name", options.name, ForOperators("What it is called."));
}

VisitOptions VisitorOf(HouseOptions& options) {
  return [&options](OptionVisitor& visitor) { Visit(visitor, options); };
}

TEST(OperatorKeys, ComeFirstAndTheOthersStandBelowTheHeading) {
  HouseOptions options;
  EXPECT_EQ(
      PrintYaml(VisitorOf(options)),
      "# What a person who runs this may want to set. Every key has a default, which is shown here.\n"
      "house:  # The house.\n"
      "  inside:  # Behind the door.\n"
      "    # How many rooms it has.\n"
      "    rooms: 3  # [1..9]\n"
      "# What it is called.\n"
      "name: \"old\"\n"
      "\n"
      "# Everything else, for experts. `expert` is only a heading: a key below it has the same name as without it,\n"
      "# for example --set slam.gate.distance_m=0.5, and a file may leave the heading out.\n"
      "expert:\n"
      "  house:  # The house.\n"
      "    # How thick its walls are.\n"
      "    wall_m: 0.1  # [0..1 m]\n"
      "    inside:  # Behind the door.\n"
      "      # Whether it has a cellar.\n"
      "      cellar: true\n");
}

TEST(OperatorKeys, WhatIsPrintedReadsBack) {
  HouseOptions options{7, 0.25, false, "expert:"};
  HouseOptions read;
  const auto result = ApplyYaml(PrintYaml(VisitorOf(options)), "printed", VisitorOf(read));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(read, options);
}

TEST(OperatorKeys, TheHeadingIsNoPartOfAName) {
  for (const char* text : {"house: {wall_m: 0.5}\n", "expert: {house: {wall_m: 0.5}}\n",
                           "house:\n  # inside: {rooms: 2}\nexpert:\n  house:\n    wall_m: 0.5\n"}) {
    HouseOptions options;
    const auto result = ApplyYaml(text, "h.yaml", VisitorOf(options));
    ASSERT_TRUE(result) << text << result.error().message;
    EXPECT_EQ(options.wall_m, 0.5) << text;
  }
  HouseOptions options;
  EXPECT_TRUE(ApplyYaml("expert:\n", "h.yaml", VisitorOf(options)));
  const auto complaint = [&](const char* text) {
    const auto result = ApplyYaml(text, "h.yaml", VisitorOf(options));
    return result ? "" : result.error().message;
  };
  EXPECT_EQ(complaint("expert:\n  house:\n    wall_m: 7\n"),
            "h.yaml:3: house.wall_m: '7' is out of range (allowed: 0..1 m)");
  EXPECT_THAT(complaint("expert:\n  expert:\n    house: {wall_m: 0.2}\n"), testing::HasSubstr("unknown key"));
  EXPECT_THAT(complaint("house:\n  expert: {wall_m: 0.2}\n"), testing::HasSubstr("house.expert.wall_m: unknown key"));
  EXPECT_THAT(complaint("expert: 5\n"), testing::HasSubstr("expert: unknown key"));
  EXPECT_FALSE(ApplySet({"expert.house.wall_m=0.2"}, VisitorOf(options)));
  EXPECT_EQ(options, HouseOptions{});
}

TEST(OperatorKeys, AKeyBelowTheHeadingAndWithoutItIsGivenTwice) {
  for (const char* text :
       {"house: {wall_m: 0.5}\nexpert: {house: {wall_m: 0.6}}\n",
        "expert: {house: {wall_m: 0.6}}\nhouse: {wall_m: 0.5}\n", "house: {wall_m: }\nexpert: {house: {wall_m: 0.6}}\n",
        "expert: {house: {wall_m: 0.6}}\nhouse: {wall_m: }\n"}) {
    HouseOptions options;
    const auto result = ApplyYaml(text, "h.yaml", VisitorOf(options));
    ASSERT_FALSE(result) << text;
    EXPECT_EQ(result.error().message, "h.yaml:2: house.wall_m: given twice") << text;
  }
}

TEST(OperatorKeys, ALongExplanationIsBrokenBetweenWords) {
  std::string help, word = "wordy";
  for (int i = 0; i < 60; ++i) help += (i == 0 ? "" : " ") + word;
  bool flag = true;
  const std::string text =
      PrintYaml([&](OptionVisitor& visitor) { visitor.Flag("flag", flag, std::string_view(help)); });
  std::istringstream lines(text);
  std::string joined;
  int count = 0;
  for (std::string line; std::getline(lines, line) && line.front() == '#'; ++count) {
    EXPECT_LE(line.size(), 110U);
    joined += (joined.empty() ? "" : " ") + line.substr(2);
  }
  EXPECT_EQ(count, 4);
  EXPECT_EQ(joined, help);
}

}  // namespace
}  // namespace cairn
