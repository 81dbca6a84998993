#include "common/sensor/odometry.h"

#include <gtest/gtest.h>

#include <limits>

namespace cairn {
namespace {

TEST(ValidateOdometry, AcceptsPosesFarFromTheOrigin) {
  EXPECT_TRUE(ValidateOdometry({1, 2, {576.5, 0.1, -2.2}}));
  EXPECT_TRUE(ValidateOdometry({1, 2, {1e7, -1e7, 3.0}}));
}

TEST(ValidateOdometry, RefusesWhatIsNoPlace) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
  for (const Pose2& pose : {Pose2{kNan, 0, 0}, Pose2{0, kInf, 0}, Pose2{0, 0, kNan}, Pose2{1.0001e7, 0, 0},
                            Pose2{0, -1e300, 0}, Pose2{0, 0, 1e18}}) {
    const auto result = ValidateOdometry({1, 2, pose});
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, StatusCode::kInvalidArgument);
    EXPECT_FALSE(result.error().message.empty());
  }
}

}  // namespace
}  // namespace cairn
