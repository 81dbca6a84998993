#include <gtest/gtest.h>

#include "server/slam/motion/step_motion.h"

namespace cairn::slam {
namespace {

TEST(ConstantSpeed, GoesOnAsInTheLastStep) {
  ConstantSpeed speed;
  EXPECT_EQ(speed.Forecast(1.0), Pose2{});
  speed.Moved({0.4, 0.1, -0.2}, 2.0);
  const Pose2 next = speed.Forecast(1.0);
  EXPECT_DOUBLE_EQ(next.x, 0.2);
  EXPECT_EQ(next.y, 0.0);
  EXPECT_DOUBLE_EQ(next.theta, -0.1);
  EXPECT_EQ(speed.Forecast(10.0), Pose2{}) << "so long ago it means nothing";
  speed.Moved({0.4, 0.0, 0.0}, 0.0);  // Two scans of one stamp.
  EXPECT_EQ(speed.Forecast(1.0), Pose2{});
  speed.Moved({0.4, 0.0, 0.0}, 1.0);
  speed.Forget();
  EXPECT_EQ(speed.Forecast(1.0), Pose2{});
}

}  // namespace
}  // namespace cairn::slam
