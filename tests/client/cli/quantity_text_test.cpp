#include "client/cli/quantity_text.h"

#include <gtest/gtest.h>

namespace cairn::client {
namespace {

TEST(ParseDuration, KnowsItsUnits) {
  EXPECT_EQ(*ParseDuration("5"), 5.0);
  EXPECT_EQ(*ParseDuration("2.5s"), 2.5);
  EXPECT_EQ(*ParseDuration("500ms"), 0.5);
  EXPECT_EQ(*ParseDuration("3m"), 180.0);
  EXPECT_EQ(*ParseDuration("1h"), 3600.0);
  EXPECT_EQ(*ParseDuration("0"), 0.0);
}

TEST(ParseDuration, RefusesWhatIsNoneAndNamesIt) {
  for (const char* text : {"", "s", "-1", "5x", "5 s", "nan", "inf", "1e999", "0x10", "1,5", " 5"}) {
    const auto duration = ParseDuration(text);
    ASSERT_FALSE(duration) << text;
    EXPECT_NE(duration.error().message.find(std::string("'") + text + "'"), std::string::npos);
  }
}

TEST(ParseArea, NeedsAnAreaWithASize) {
  const auto area = ParseArea("-5,-4,20,10");
  ASSERT_TRUE(area);
  EXPECT_EQ(area->x_min_m, -5);
  EXPECT_EQ(area->y_max_m, 10);
  for (const char* text : {"0,0,0,1", "5,0,1,1", "1,2,3", "1,2,3,4m"}) EXPECT_FALSE(ParseArea(text)) << text;
}

TEST(ParseLabelledFile, TakesTheStemWhereNoLabelIsGiven) {
  EXPECT_EQ(ParseLabelledFile("robot 1=out/r1.tum").label, "robot 1");
  EXPECT_EQ(ParseLabelledFile("robot 1=out/r1.tum").path, "out/r1.tum");
  EXPECT_EQ(ParseLabelledFile("out/r1.tum").label, "r1");
  EXPECT_EQ(ParseLabelledFile("out/r1.tum").path, "out/r1.tum");
}

TEST(FormatDuration, PicksTheUnitPeopleWouldUse) {
  EXPECT_EQ(FormatDuration(0.85), "850 ms");
  EXPECT_EQ(FormatDuration(12.34), "12.3 s");
  EXPECT_EQ(FormatDuration(245), "4 min 05 s");
  EXPECT_EQ(FormatDuration(7380), "2 h 03 min");
}

}  // namespace
}  // namespace cairn::client
