#include "common/geometry/angle.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Angle, StaysWithinHalfATurn) {
  for (double angle = -50.0; angle < 50.0; angle += 0.037) {
    const double wrapped = WrapAngle(angle);
    EXPECT_GT(wrapped, -kPi);
    EXPECT_LE(wrapped, kPi);
    EXPECT_NEAR(std::sin(wrapped), std::sin(angle), 1e-12);
    EXPECT_NEAR(std::cos(wrapped), std::cos(angle), 1e-12);
  }
}

TEST(Angle, HalfATurnIsPositive) {
  EXPECT_EQ(WrapAngle(kPi), kPi);
  EXPECT_EQ(WrapAngle(-kPi), kPi);
  EXPECT_EQ(WrapAngle(3 * kPi), kPi);
  EXPECT_EQ(WrapAngle(-3 * kPi), kPi);
}

TEST(Angle, InsideValuesAreUntouched) {
  for (const double angle : {0.0, 1e-300, -1e-17, 3.0, -3.1415926, 0.1}) EXPECT_EQ(WrapAngle(angle), angle);
}

TEST(Angle, JustBeyondTheEdgeComesOutAtTheOtherEnd) {
  const double beyond = std::nextafter(kPi, 4.0);
  EXPECT_LT(WrapAngle(beyond), 0.0);
  EXPECT_GT(WrapAngle(-beyond), 0.0);
  EXPECT_LE(WrapAngle(-beyond), kPi);
}

TEST(Angle, DifferenceTakesTheShorterWay) {
  EXPECT_NEAR(AngleDiff(Radians(179), Radians(-179)), Radians(-2), 1e-12);
  EXPECT_NEAR(AngleDiff(Radians(-179), Radians(179)), Radians(2), 1e-12);
  EXPECT_NEAR(AngleDiff(0.3, 0.1), 0.2, 1e-15);
}

TEST(Angle, LineDirectionsHaveNoSense) {
  EXPECT_NEAR(LineAngleDiff(Radians(10), Radians(190)), 0.0, 1e-12);
  EXPECT_NEAR(LineAngleDiff(Radians(89), Radians(-89)), Radians(-2), 1e-12);
  EXPECT_NEAR(LineAngleDiff(Radians(90), 0.0), kPi / 2, 1e-12);
  for (double a = -10.0; a < 10.0; a += 0.13) {
    const double diff = LineAngleDiff(a, 1.0);
    EXPECT_GT(diff, -kPi / 2 - 1e-12);
    EXPECT_LE(diff, kPi / 2 + 1e-12);
    EXPECT_NEAR(std::sin(diff - (a - 1.0)), 0.0, 1e-12);
  }
}

TEST(Angle, DegreesAndBack) {
  EXPECT_DOUBLE_EQ(Degrees(Radians(123.4)), 123.4);
  EXPECT_DOUBLE_EQ(Radians(180), kPi);
}

}  // namespace
}  // namespace cairn
