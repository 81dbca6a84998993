#include "common/service/start_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace cairn {
namespace {

TEST(ParseStart, ReadsRadiansAndDegrees) {
  EXPECT_EQ(*ParseStart("1.5,-2,0.5"), (Pose2{1.5, -2, 0.5}));
  EXPECT_EQ(*ParseStart("-1.5, -2, 90deg"), (Pose2{-1.5, -2, Radians(90)}));
  EXPECT_NEAR(ParseStart("0,0,450deg")->theta, Radians(90), 1e-12) << "wrapped";
}

TEST(ParseStart, RefusesWhatIsNoneAndNamesIt) {
  for (const char* text : {"", "1,2", "1,2,3,4", "a,b,c", "1,2,", "1,2,90degrees", "1deg,2,3", "nan,0,0", "0,0,inf",
                           "0,0,1e7", "1e999,0,0", "0x1,0,0"}) {
    const auto start = ParseStart(text);
    ASSERT_FALSE(start) << text;
    EXPECT_THAT(start.error().message, ::testing::HasSubstr("'" + std::string(text) + "'"));
  }
}

TEST(ParseStart, RefusesWhatTheServerWould) {
  EXPECT_TRUE(ParseStart("1e6,-1e6,0"));
  for (const char* text : {"1000001,0,0", "0,-1e9,0deg"}) {
    const auto start = ParseStart(text);
    ASSERT_FALSE(start) << text;
    EXPECT_THAT(start.error().message, ::testing::HasSubstr("more than 1000 km away"));
  }
}

TEST(ValidateStart, RefusesWhatIsNotFiniteOrTooLarge) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(ValidateStart({1e6, -1e6, 3.0}));
  for (const Pose2& pose :
       {Pose2{kNan, 0, 0}, Pose2{0, kInf, 0}, Pose2{0, 0, kNan}, Pose2{0, -1.1e6, 0}, Pose2{0, 0, 1e7}})
    EXPECT_FALSE(ValidateStart(pose));
}

}  // namespace
}  // namespace cairn
