#include "server/slam/matchers/line_least_squares.h"

#include <gtest/gtest.h>

#include "server/slam/features/feature_extraction.h"
#include "tests/numerical_derivative.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

std::vector<LineFeature> OfficeLines() {
  return ExtractFeatures(test::Look(test::Office(), {-0.5, 0.2, 0.1}, {}), FeatureOptions{}).lines;
}

// Pairs every line with itself; the current line is seen from T_ref_curr.
std::vector<WeightedPair> PairsMovedBy(const std::vector<LineFeature>& lines, const Pose2& T_ref_curr) {
  std::vector<WeightedPair> pairs;
  for (const LineFeature& line : lines) {
    const PointNormal wall = MidpointAndNormal(line);
    pairs.push_back({wall, Transform(T_ref_curr.Inverse(), wall), line.length});
  }
  return pairs;
}

void ExpectNear(const Pose2& a, const Pose2& b, double tolerance) {
  EXPECT_LT((a.translation() - b.translation()).norm(), tolerance);
  EXPECT_LT(std::abs(AngleDiff(a.theta, b.theta)), tolerance);
}

TEST(LineLeastSquares, RecoversTheEightTransformsOfTable51) {
  const std::vector<LineFeature> lines = OfficeLines();
  ASSERT_GE(lines.size(), 5U);
  for (const double x : {-5.0, 0.5}) {
    for (const double y : {-0.3, 7.0}) {
      for (const double theta : {-1.5 * kPi, kPi / 6}) {
        const Pose2 truth{x, y, WrapAngle(theta)};
        const LineAlignment answer = AlignLinePairs(PairsMovedBy(lines, truth), {}, {});
        EXPECT_TRUE(answer.converged);
        ExpectNear(answer.T_ref_curr, truth, 1e-6);
        // Chi falls to zero, "quickly ... after a few iterations" (5.4.2), and stays there.
        EXPECT_GT(answer.chi.front(), 0.05);
        EXPECT_LT(answer.chi.back(), 1e-12);
        EXPECT_LE(answer.chi.size(), 14U);
      }
    }
  }
}

TEST(LineLeastSquares, TheThesisWeightsRecoverThemToo) {
  LineLeastSquaresOptions thesis;
  thesis.length_power = 0.0;
  thesis.max_iterations = 100;
  const Pose2 truth{0.5, 7.0, kPi / 6};
  ExpectNear(AlignLinePairs(PairsMovedBy(OfficeLines(), truth), {}, thesis).T_ref_curr, truth, 1e-6);
}

TEST(LineLeastSquares, ChiFallsWithEveryStepNearTheAnswer) {
  const LineAlignment answer = AlignLinePairs(PairsMovedBy(OfficeLines(), {0.4, -0.3, 0.3}), {}, {});
  ASSERT_GE(answer.chi.size(), 3U);
  for (std::size_t k = 1; k < answer.chi.size(); ++k) EXPECT_LE(answer.chi[k], answer.chi[k - 1] + 1e-15);
}

TEST(LineLeastSquares, TheJacobianIsTheDerivative) {
  for (const Pose2& T : {Pose2{}, Pose2{1.0, -2.0, 0.7}, Pose2{-5.0, 7.0, -2.5}}) {
    const PointNormal curr{{1.2, -0.4}, {std::cos(0.3), std::sin(0.3)}}, prev{{0.3, 2.0}, {0.0, 1.0}};
    const auto error = [&](const Eigen::Vector3d& step) {
      return LineError(Transform(Pose2{step.x(), step.y(), step.z()} * T, curr), prev);
    };
    const Eigen::Matrix<double, 4, 3> numerical = NumericalDerivative<4, 3>(error, Eigen::Vector3d::Zero().eval());
    EXPECT_LT((numerical - J_error_step(Transform(T, curr))).cwiseAbs().maxCoeff(), 1e-7);
  }
}

TEST(LineLeastSquares, InformationIsAcrossTheWall) {
  const Eigen::Vector2d n(std::cos(0.8), std::sin(0.8)), u(-n.y(), n.x());
  const Eigen::Matrix4d omega = LineInformation(n, 0.01, 0.1);
  EXPECT_NEAR(n.dot(omega.topLeftCorner<2, 2>() * n), 1.0, 1e-12);
  EXPECT_NEAR(u.dot(omega.topLeftCorner<2, 2>() * u), 0.01, 1e-12);
  EXPECT_NEAR(n.dot(omega.topLeftCorner<2, 2>() * u), 0.0, 1e-12);
  EXPECT_NEAR(omega(2, 2), 0.1, 1e-12);
}

TEST(LineLeastSquares, WithoutPairsNothingMoves) {
  const LineAlignment answer = AlignLinePairs({}, {1, 2, 3}, {});
  EXPECT_FALSE(answer.converged);
  EXPECT_EQ(answer.T_ref_curr, (Pose2{1, 2, 3}));
}

}  // namespace
}  // namespace cairn::slam
