#include "tests/studies/mapper/path_errors.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "common/geometry/pose_difference.h"
#include "tests/server/slam/nees_bounds.h"

namespace cairn::studies {
namespace {

using slam::OptimisePoses, slam::PoseRelation, slam::PoseRelationError, slam::Rng, slam::ThreeNormalDraws;

constexpr int kSamples = 400;
const Eigen::Matrix3d kStepCovariance = Eigen::Vector3d(4e-4, 1e-4, 2e-4).asDiagonal();
const Eigen::Matrix3d kLoopCovariance = Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();

Pose2 WithNoise(const Pose2& pose, const Eigen::Matrix3d& covariance, Rng& rng) {
  return Plus(pose, covariance.llt().matrixL() * ThreeNormalDraws(rng));
}

// A drive round a square of 40 steps, as measured; the last pose sees the first one again.
struct FittedDrive {
  std::vector<Pose2> truth{{1, 2, 0.5}};
  std::vector<Pose2> path{truth};
  std::vector<PoseRelation> relations;

  FittedDrive(bool loop, Rng& rng) {
    for (std::size_t k = 0; k < 40; ++k) {
      const Pose2 step{0.5, 0.0, k % 10 == 9 ? kPi / 2 : 0.0};
      const Pose2 seen = WithNoise(step, kStepCovariance, rng);
      truth.push_back(truth.back() * step);
      path.push_back(path.back() * seen);
      relations.push_back({k, k + 1, seen, kStepCovariance, false});
    }
    if (!loop) return;
    relations.push_back({0, 40, WithNoise(Between(truth[0], truth[40]), kLoopCovariance, rng), kLoopCovariance, true});
    EXPECT_TRUE(OptimisePoses(path, relations, {}).usable);
  }
};

// NEES of the pose `to` relative to `from`.
double NeesOf(const FittedDrive& drive, std::size_t from, std::size_t to, const std::vector<PoseErrorSamples>& errors) {
  const Eigen::Vector3d error =
      Minus(Between(drive.path[from], drive.path[to]), Between(drive.truth[from], drive.truth[to]));
  const Eigen::Matrix3d covariance = RelativeCovariance(drive.path[from], errors[from], drive.path[to], errors[to]);
  return error.dot(covariance.ldlt().solve(error));
}

double MeanNees(bool loop, std::size_t from, std::size_t to, int runs) {
  Rng rng(3);
  double sum = 0.0;
  for (int run = 0; run < runs; ++run) {
    const FittedDrive drive(loop, rng);
    sum += NeesOf(drive, from, to, SamplePathErrors(drive.path, drive.relations, kSamples, rng));
  }
  return sum / runs;
}

TEST(PathErrors, AreAsLargeAsTheErrorsOfPathsWithoutAndWithALoop) {
  constexpr int kRuns = 150;
  const auto [low, high] = slam::test::NeesBoundsOf(kRuns);
  for (const bool loop : {false, true}) {
    for (const auto& [from, to] : {std::pair{0U, 20U}, std::pair{10U, 35U}, std::pair{0U, 40U}}) {
      const double nees = MeanNees(loop, from, to, kRuns);
      EXPECT_GT(nees, low) << loop << " " << from << " " << to;
      EXPECT_LT(nees, high) << loop << " " << from << " " << to;
    }
  }
}

TEST(PathErrors, OfThePoseThatALoopJoinsAreThoseOfTheLoop) {
  Rng rng(4);
  const FittedDrive drive(true, rng);
  const auto errors = SamplePathErrors(drive.path, drive.relations, kSamples, rng);
  const Eigen::Matrix3d ends = RelativeCovariance(drive.path[0], errors[0], drive.path[40], errors[40]);
  const Eigen::Matrix3d middle = RelativeCovariance(drive.path[0], errors[0], drive.path[20], errors[20]);
  EXPECT_NEAR(ends(0, 0) / kLoopCovariance(0, 0), 1.0, 0.2);
  EXPECT_GT((middle.topLeftCorner<2, 2>().trace()), (10.0 * ends.topLeftCorner<2, 2>().trace()));
  EXPECT_TRUE(errors[0].isZero());
}

TEST(PathErrors, ALoopThatIsOutvotedAddsNoCertainty) {
  Rng rng(5);
  FittedDrive drive(false, rng);
  const auto without = SamplePathErrors(drive.path, drive.relations, kSamples, rng);
  drive.relations.push_back({0, 40, Between(drive.path[0], drive.path[40]) * Pose2{50, 0, 0}, kLoopCovariance, true});
  const auto with = SamplePathErrors(drive.path, drive.relations, kSamples, rng);
  const auto at_the_end = [&](const std::vector<PoseErrorSamples>& errors) {
    return RelativeCovariance(drive.path[0], errors[0], drive.path[40], errors[40]).trace();
  };
  EXPECT_NEAR(at_the_end(with) / at_the_end(without), 1.0, 0.25);
}

}  // namespace
}  // namespace cairn::studies
