#include <gtest/gtest.h>

#include <random>

#include "common/geometry/pose2.h"
#include "tests/numerical_derivative.h"

namespace cairn {
namespace {

Pose2 ToPose(const Eigen::Vector3d& v) {
  return {v(0), v(1), v(2)};
}

// Headings well inside (-pi, pi], sums as well: differences must not jump by a turn.
class Pose2Jacobian : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    std::mt19937_64 random(static_cast<unsigned>(GetParam()));
    std::uniform_real_distribution<double> metres(-5.0, 5.0), radians(-1.4, 1.4);
    a_ = {metres(random), metres(random), radians(random)};
    b_ = {metres(random), metres(random), radians(random)};
  }
  Pose2 a_, b_;
};

TEST_P(Pose2Jacobian, ComposeLeft) {
  const auto f = [&](const Eigen::Vector3d& v) { return (ToPose(v) * b_).vector(); };
  const auto J = NumericalDerivative<3, 3>(f, a_.vector());
  EXPECT_NEAR((J - J_compose_left(a_, b_)).cwiseAbs().maxCoeff(), 0.0, 1e-7);
}

TEST_P(Pose2Jacobian, ComposeRight) {
  const auto f = [&](const Eigen::Vector3d& v) { return (a_ * ToPose(v)).vector(); };
  const auto J = NumericalDerivative<3, 3>(f, b_.vector());
  EXPECT_NEAR((J - J_compose_right(a_, b_)).cwiseAbs().maxCoeff(), 0.0, 1e-7);
}

TEST_P(Pose2Jacobian, Inverse) {
  const auto f = [&](const Eigen::Vector3d& v) { return ToPose(v).Inverse().vector(); };
  const auto J = NumericalDerivative<3, 3>(f, a_.vector());
  EXPECT_NEAR((J - J_inverse(a_)).cwiseAbs().maxCoeff(), 0.0, 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Poses, Pose2Jacobian, testing::Range(1, 13));

TEST(NumericalDerivative, FindsTheSlopeOfACubic) {
  const auto f = [](const Eigen::Matrix<double, 1, 1>& x) { return Eigen::Matrix<double, 1, 1>(x * x * x); };
  EXPECT_NEAR((NumericalDerivative<1, 1>(f, Eigen::Matrix<double, 1, 1>(2.0))(0, 0)), 12.0, 1e-6);
}

}  // namespace
}  // namespace cairn
