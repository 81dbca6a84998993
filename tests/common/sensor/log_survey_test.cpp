#include "common/sensor/log_survey.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace cairn {
namespace {

// A drive through rooms: ranges spread over 0.5 .. 20 m; a share of all beams, anywhere, hits nothing.
LaserSurvey Drive(double no_return_share, const std::vector<float>& saturated, int scans = 200) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::uniform_real_distribution<float> range(0.5F, 20.0F);
  LaserSurvey survey;
  for (int i = 0; i < scans; ++i) {
    LaserMessage laser;
    for (int k = 0; k < 180; ++k) {
      const bool none = share(random) < no_return_share;
      laser.ranges_m.push_back(none ? saturated[random() % saturated.size()] : range(random));
    }
    survey.Add(laser);
  }
  return survey;
}

TEST(LaserSurvey, FindsThePileOfSaturatedReadings) {
  const auto no_return = Drive(0.02, {51.0F, 51.05F, 51.06F, 51.06F, 51.06F, 51.07F, 51.11F, 51.22F}).NoReturn();
  ASSERT_TRUE(no_return);
  EXPECT_GT(*no_return, 50.9);
  EXPECT_LE(*no_return, 51.0);
}

TEST(LaserSurvey, AFewWildReadingsAboveDoNotHideIt) {
  LaserSurvey survey = Drive(0.05, {29.99F});
  LaserMessage wild;
  wild.ranges_m = {45.0F, 60.0F, 77.7F};
  survey.Add(wild);
  ASSERT_TRUE(survey.NoReturn());
  EXPECT_NEAR(*survey.NoReturn(), 29.99, 0.05);
}

TEST(LaserSurvey, WithoutSaturationThereIsNone) {
  EXPECT_FALSE(Drive(0.0, {50.0F}).NoReturn());
}

TEST(LaserSurvey, AWallStaredAtIsNotSaturation) {
  // The robot stands still: ten neighbouring beams see the farthest wall, at 20.00 m, again and again.
  LaserSurvey survey;
  for (int i = 0; i < 500; ++i) {
    LaserMessage laser;
    for (int k = 0; k < 180; ++k)
      laser.ranges_m.push_back(k >= 85 && k < 95 ? 20.0F : 2.0F + 0.05F * static_cast<float>(k));
    survey.Add(laser);
  }
  EXPECT_FALSE(survey.NoReturn());
}

TEST(LaserSurvey, AFewScansProveNothing) {
  EXPECT_FALSE(Drive(0.05, {51.06F}, 3).NoReturn());
  EXPECT_FALSE(LaserSurvey().NoReturn());
}

TEST(LaserSurvey, BadReadingsAreNoReadings) {
  LaserSurvey survey;
  LaserMessage laser;
  laser.ranges_m.assign(1000, NAN);
  laser.ranges_m.resize(2000, INFINITY);
  laser.ranges_m.resize(3000, -1.0F);
  laser.ranges_m.resize(4000, 1e30F);
  survey.Add(laser);
  EXPECT_FALSE(survey.NoReturn());
}

TEST(LaserSurvey, MountingIsTheMedianRounded) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 1e-4);
  LaserSurvey survey;
  for (int i = 0; i < 20'000; ++i) {
    LaserMessage laser;
    laser.ranges_m = {1.0F};
    laser.T_odom_robot = Pose2{i * 0.01, 3.0, WrapAngle(i * 0.001)};
    const Pose2 T_robot_laser{0.1234 + noise(random), noise(random), kPi};
    laser.T_odom_laser = *laser.T_odom_robot * (i % 50 == 0 ? Pose2{2, 2, 2} : T_robot_laser);  // Some outliers.
    survey.Add(laser);
  }
  const auto mounting = survey.Mounting();
  ASSERT_TRUE(mounting);
  EXPECT_EQ(mounting->x, 0.123);
  EXPECT_EQ(mounting->y, 0.0);
  EXPECT_NEAR(std::abs(mounting->theta), kPi, 1e-4);
}

}  // namespace
}  // namespace cairn
