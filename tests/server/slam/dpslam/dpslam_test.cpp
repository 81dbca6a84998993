#include "server/slam/dpslam/dpslam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/server/slam/dpslam/drive.h"

namespace cairn::slam {
namespace {

DpSlamOptions Small(bool hierarchical) {
  DpSlamOptions options;
  options.hierarchical = hierarchical;
  options.low.particles = 80;
  options.high.particles = 80;
  options.segment.length_m = 3.0;
  return options;
}

void Step(DpSlam& filter, const DriveStep& step, bool first) {
  if (!first) filter.Predict(step.T_prev_curr, Eigen::Matrix3d::Zero());
  filter.Observe(KeyframeSight{step.scan, {}, {}, 0.0}, SerialFor);
  filter.Commit();
}

class DpSlamOf : public testing::TestWithParam<bool> {};

TEST_P(DpSlamOf, KeepsTrackRoundARing) {
  const auto drive = DriveRing(8.0, 7.0, 1.1, 61, 11);
  DpSlam filter(Small(GetParam()), drive[0].T_map_robot, 1);
  Pose2 odometry = drive[0].T_map_robot;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    if (i > 0) odometry = odometry * drive[i].T_prev_curr;
    Step(filter, drive[i], i == 0);
    EXPECT_TRUE(IsCovariance(filter.estimate().covariance, 1e-6));
  }
  const Pose2& truth = drive.back().T_map_robot;
  const double error = (filter.estimate().T_map_robot.translation() - truth.translation()).norm();
  EXPECT_LT(error, 0.3);
  EXPECT_LT(error, 0.5 * (odometry.translation() - truth.translation()).norm());
  EXPECT_FALSE(filter.health().diverged);
  EXPECT_GT(filter.low().gain(), 0.0);
}

TEST_P(DpSlamOf, EveryHypothesisHasAPoseForEveryStep) {
  const auto drive = DriveRing(9.0, 7.0, 0.4, 61, 12);
  DpSlam filter(Small(GetParam()), drive[0].T_map_robot, 2);
  for (std::size_t i = 0; i < drive.size(); ++i) {
    Step(filter, drive[i], i == 0);
    ASSERT_EQ(filter.hypothesis_count(), 80u);
    for (std::size_t h = 0; h < 80; h += 29) {
      const Hypothesis hypothesis = filter.hypothesis(h);
      ASSERT_EQ(hypothesis.path.size(), i + 1);
      ASSERT_LT((hypothesis.path[i].translation() - hypothesis.T_map_robot.translation()).norm(), 1e-9);
    }
  }
  // The best path moves as the robot did, over joints too.
  const Hypothesis best = filter.hypothesis(0);
  for (std::size_t k = 1; k < best.path.size(); ++k) {
    const Pose2 step = Between(best.path[k - 1], best.path[k]),
                truth = Between(drive[k - 1].T_map_robot, drive[k].T_map_robot);
    EXPECT_LT((step.translation() - truth.translation()).norm(), 0.15);
  }
}

TEST_P(DpSlamOf, SameSeedSameBytesOnAnyNumberOfThreads) {
  const auto drive = DriveRing(9.0, 7.0, 0.4, 61, 13);
  DpSlam one(Small(GetParam()), drive[0].T_map_robot, 3), many(Small(GetParam()), drive[0].T_map_robot, 3);
  for (const DriveStep& step : drive) {
    for (DpSlam* filter : {&one, &many}) {
      filter->Predict(step.T_prev_curr, Eigen::Matrix3d::Zero());
      filter->Observe(KeyframeSight{step.scan, {}, {}, 0.0}, filter == &one ? ParallelFor(SerialFor) : InBlocks(5));
      filter->Commit();
    }
    ASSERT_EQ(one.estimate().T_map_robot, many.estimate().T_map_robot);
  }
  EXPECT_EQ(one.MapImage().cells, many.MapImage().cells);
}

TEST_P(DpSlamOf, AnyValidScanIsSurvived) {
  DpSlam filter(Small(GetParam()), {}, 4);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  std::vector<Scan> scans(7);
  for (Scan& scan : scans) {
    scan.angle_first_rad = -1.5;
    scan.angle_step_rad = 0.01;
    scan.range_min_m = 0.01;
    scan.range_max_m = 30.0;
  }
  scans[0].ranges_m = {nan, nan, inf};
  scans[1].ranges_m = {2.0F};
  scans[2].ranges_m.assign(8192, 3.0F);
  scans[2].angle_step_rad = 2.0 * kPi / 8193;
  scans[3].ranges_m.assign(8192, nan);
  scans[3].ranges_m[17] = 0.02F;
  scans[3].angle_step_rad = -2.0 * kPi / 8193;
  scans[4].ranges_m = {29.9F, 29.9F, 29.9F};
  scans[5].ranges_m.assign(300, inf);
  scans[6].ranges_m.assign(100, 1.0F);
  scans[6].tilt_rad = 1.57;
  for (int round = 0; round < 4; ++round) {
    for (const Scan& scan : scans) {
      ASSERT_TRUE(ValidateScan(scan));
      filter.Predict({round == 3 ? 1e7 : 0.3, 0.0, 0.3}, Eigen::Matrix3d::Zero());
      filter.Observe(KeyframeSight{scan, {}, {}, 0.0}, SerialFor);
      filter.Commit();
      ASSERT_TRUE(filter.estimate().T_map_robot.IsFinite());
      ASSERT_TRUE(filter.estimate().covariance.allFinite());
    }
  }
  filter.Predict({0.1, 0.0, 0.0}, Eigen::Matrix3d::Zero());
  filter.Commit();  // A step without sight.
  EXPECT_EQ(filter.hypothesis(0).path.size(), 29u);
}

TEST_P(DpSlamOf, SaysSoWhenTheWorldContradictsItsMap) {
  const auto drive = DriveRing(8.0, 7.0, 0.3, 61, 14);
  DpSlamOptions options = Small(GetParam());
  options.diverged_after = 5;
  options.segment.length_m = 1000.0;
  options.segment.max_scans = 10000;
  DpSlam filter(options, drive[0].T_map_robot, 5);
  for (std::size_t i = 0; i < drive.size(); ++i) Step(filter, drive[i], i == 0);
  ASSERT_FALSE(filter.health().diverged);
  // Suddenly walls stand far nearer, each time elsewhere, while the robot believes that it stands still.
  bool said = false;
  for (int i = 0; i < 6; ++i) {
    DriveStep strange = drive.back();
    strange.T_prev_curr = {};
    for (float& range : strange.scan.ranges_m) range *= 0.3F + 0.1F * static_cast<float>(i);
    Step(filter, strange, false);
    said = said || filter.health().diverged;
  }
  EXPECT_TRUE(said);
}

INSTANTIATE_TEST_SUITE_P(Levels, DpSlamOf, testing::Bool(),
                         [](const auto& levels) { return levels.param ? "Hierarchical" : "Flat"; });

TEST(DpSlam, PicturesTheBestMap) {
  const auto drive = DriveRing(9.0, 7.0, 0.2, 181, 15);
  DpSlam filter(Small(false), drive[0].T_map_robot, 6);
  for (std::size_t i = 0; i < drive.size(); ++i) Step(filter, drive[i], i == 0);
  const OccupancyImage image = filter.MapImage();
  ASSERT_GT(image.width, 0);
  const auto at = [&](double x, double y) {
    const auto column = static_cast<std::size_t>((x - image.T_map_origin.x) / image.resolution_m);
    const auto row = static_cast<std::size_t>((y - image.T_map_origin.y) / image.resolution_m);
    return image.cells[row * static_cast<std::size_t>(image.width) + column];
  };
  EXPECT_LT(at(3.0, 1.0), 10);            // On the way.
  EXPECT_EQ(at(4.5, 3.5), kUnknownCell);  // Within the core.
  int wall = 0;
  for (double x = 3.5; x < 5.5; x += 0.05) wall += std::max(at(x, 1.98), at(x, 2.02)) > 50;
  EXPECT_GT(wall, 30);
}

}  // namespace
}  // namespace cairn::slam
