#include "server/slam/dpslam/dpslam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/server/slam/dpslam/drive.h"

namespace cairn::slam {
namespace {

enum class Levels : std::uint8_t { kFlat, kMoving, kPlain };

DpSlamOptions Small(Levels levels) {
  DpSlamOptions options;
  options.hierarchical = levels != Levels::kFlat;
  if (levels == Levels::kPlain) options.high_level = HighLevelKind::kPlain;
  options.low.particles = 80;
  options.high.particles = 80;
  options.segment.length_m = 3.0;
  return options;
}

void Step(DpSlam& filter, const DriveStep& step, bool first) {
  if (!first) filter.Predict({step.T_prev_curr});
  filter.Observe(KeyframeSight{step.scan, {}, {}, 0.0}, SerialFor);
  filter.Commit();
}

class DpSlamOf : public testing::TestWithParam<Levels> {};

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
  // A low level that has just begun a new map has few cells to compare with.
  if (GetParam() != Levels::kPlain) {
    EXPECT_GT(filter.low().gain(), 0.0);
  }
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
  // The best path moves as the robot did, also across joints.
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
      filter->Predict({step.T_prev_curr});
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
      filter.Predict({{round == 3 ? 1e7 : 0.3, 0.0, 0.3}});
      filter.Observe(KeyframeSight{scan, {}, {}, 0.0}, SerialFor);
      filter.Commit();
      ASSERT_TRUE(filter.estimate().T_map_robot.IsFinite());
      ASSERT_TRUE(filter.estimate().covariance.allFinite());
    }
  }
  filter.Predict({{0.1, 0.0, 0.0}});
  filter.Commit();  // A step without a scan.
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
  // Suddenly the walls are much nearer, each time elsewhere, while the robot believes that it does not move.
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

INSTANTIATE_TEST_SUITE_P(Levels, DpSlamOf, testing::Values(Levels::kFlat, Levels::kMoving, Levels::kPlain),
                         [](const auto& levels) {
                           return levels.param == Levels::kFlat     ? "Flat"
                                  : levels.param == Levels::kMoving ? "Hierarchical"
                                                                    : "PlainHierarchical";
                         });

// Thesis C 4.5.2: the first segment lies where it is; at every later joint each particle draws drift, is
// judged on the whole segment, and the low level begins a new map.
TEST(DpSlam, ThePlainHighLevelDrawsDriftAndResamplesAtEveryJoint) {
  const auto drive = DriveRing(8.0, 7.0, 0.8, 61, 17);
  DpSlamOptions options = Small(Levels::kPlain);
  options.high.resample_below = 1.0;
  DpSlam filter(options, drive[0].T_map_robot, 7);
  std::size_t joints = 0, scans_before = 0;
  std::size_t map_before = 0;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    Step(filter, drive[i], i == 0);
    const std::size_t scans = filter.high()->best().path.size();
    if (scans > scans_before) {
      ++joints;
      EXPECT_EQ(scans, i + 1);                                        // Handed up at once, no hindsight.
      EXPECT_EQ(filter.low().best().path.size(), 1u);                 // The low level begins at the joint,
      EXPECT_LT(filter.low().maps().ancestry().bytes(), map_before);  // with one scan in its map.
      std::size_t apart = 0;                                          // Ways that particles took since the last joint.
      for (std::size_t p = 0; p < filter.high()->particles().size(); ++p)
        apart += filter.high()->particles()[p].T_map_robot != filter.high()->particles()[0].T_map_robot ? 1 : 0;
      if (joints == 1) {
        EXPECT_EQ(apart, 0u);
        EXPECT_EQ(filter.high()->covariance().norm(), 0.0);
      } else {
        EXPECT_GT(apart, 0u);
        EXPECT_LT(filter.high()->effective_sample_size(), 79.0);   // It was judged on what its own map shows.
        EXPECT_EQ(filter.high()->particles()[0].log_weight, 0.0);  // And resampled.
      }
      EXPECT_FALSE(filter.high()->maps().blank());
    }
    scans_before = scans;
    map_before = filter.low().maps().ancestry().bytes();
  }
  EXPECT_GT(joints, 3u);
}

// Segments used to be joined at the pose that the best particle had at the joint. Corrections that the low
// level made since the last joint were lost at every joint. And the pose was the mean of samples.
TEST(DpSlam, TwoLevelsSayWhatTheLowOneSaysUntilALoopTellsThemMore) {
  const auto drive = DriveRing(30.0, 24.0, 0.4, 61, 16);
  DpSlam filter(Small(Levels::kMoving), drive[0].T_map_robot, 7);
  for (std::size_t i = 0; i < drive.size(); ++i) {
    Step(filter, drive[i], i == 0);
    const Pose2 expected = drive[0].T_map_robot * filter.low().mean();
    ASSERT_LT(Between(expected, filter.estimate().T_map_robot).vector().norm(), 1e-9) << i;
    ASSERT_TRUE(IsCovariance(filter.estimate().covariance, 1e-6));
  }
  ASSERT_GT(filter.high()->best().path.size(), 50u);
  EXPECT_GT(filter.high()->covariance().trace(), 1e-4);
}

class DpSlamMotion : public testing::TestWithParam<LowMotion> {
 protected:
  // The ring's odometry goes 1 % too far, with 3 % of noise: such a model.
  static DpSlamOptions Options() {
    DpSlamOptions options = Small(Levels::kMoving);
    options.motion = GetParam();
    options.learnt.eliazar.along = {0.99, 0.0, 0.04, 0.02, 0.003};
    options.learnt.eliazar.across = {0.0, 0.0, 0.03, 0.01, 0.003};
    options.learnt.eliazar.turn = {0.0, 0.99, 0.03, 0.05, 0.003};
    options.learnt.scan_matching.along = options.learnt.scan_matching.across = {0.004, 0.05};
    options.learnt.scan_matching.turn = {0.003, 0.05};
    return options;
  }
  // With odometry, Eliazar's model must not use the front-end's step, which has wrong values here.
  static StepMotion Measured(const DriveStep& step) {
    if (GetParam() != LowMotion::kEliazar) return {step.T_prev_curr, Eigen::Matrix3d::Zero(), {}, 0.2};
    return {{step.T_prev_curr.x, 0.5, 0.5}, 0.01 * Eigen::Matrix3d::Identity(), step.T_prev_curr};
  }
};

TEST_P(DpSlamMotion, KeepsTrackRoundARingTheSameOnAnyNumberOfThreads) {
  constexpr std::size_t kCompared = 15;  // Steps.
  const auto drive = DriveRing(8.0, 7.0, 1.1, 61, 11);
  DpSlam one(Options(), drive[0].T_map_robot, 1), many(Options(), drive[0].T_map_robot, 1);
  const auto observe = [&](DpSlam& filter, std::size_t i, const ParallelFor& parallel_for) {
    if (i > 0) filter.Predict(Measured(drive[i]));
    filter.Observe(KeyframeSight{drive[i].scan, {}, {}, 0.0}, parallel_for);
    filter.Commit();
  };
  Pose2 odometry = drive[0].T_map_robot;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    if (i > 0) odometry = odometry * drive[i].T_prev_curr;
    observe(one, i, SerialFor);
    if (i >= kCompared) continue;
    observe(many, i, InBlocks(5));
    ASSERT_EQ(one.estimate().T_map_robot, many.estimate().T_map_robot);
    ASSERT_EQ(one.MapImage().cells, many.MapImage().cells);
  }
  const Pose2& truth = drive.back().T_map_robot;
  const double error = (one.estimate().T_map_robot.translation() - truth.translation()).norm();
  EXPECT_LT(error, 0.3);
  EXPECT_LT(error, 0.5 * (odometry.translation() - truth.translation()).norm());
  EXPECT_FALSE(one.health().diverged);
}

TEST_P(DpSlamMotion, ParticlesScatterAsTheModelSays) {
  DpSlamOptions options = Options();
  options.low.particles = 20000;
  options.hierarchical = false;
  DpSlam filter(options, {}, 3);
  const DriveStep step{{}, {0.5, 0.0, 0.4}, {}};
  StepMotion measured = Measured(step);
  measured.lambda_m = 0.0;
  filter.Predict(measured);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  const auto& particles = filter.low().particles();
  const auto count = static_cast<double>(particles.size());
  const bool eliazar = GetParam() == LowMotion::kEliazar;
  for (const GridParticle& particle : particles) {
    const Eigen::Vector3d d = eliazar ? TermsOf(particle.T_map_robot) : particle.T_map_robot.vector();
    mean += d / count;
    squares += d.cwiseAbs2() / count;
  }
  Eigen::Vector3d expected = step.T_prev_curr.vector(),
                  sigma = options.low.drift.Covariance(step.T_prev_curr).diagonal();
  sigma = sigma.cwiseSqrt();
  if (eliazar) {
    const OdometryStep odometry = StepOf(step.T_prev_curr);
    for (int k = 0; k < kMotionTerms; ++k) {
      expected(k) = options.learnt.eliazar.term(k).Mean(odometry.d, odometry.b);
      sigma(k) = std::sqrt(options.learnt.eliazar.term(k).Variance(odometry.d, odometry.b));
    }
  } else if (GetParam() == LowMotion::kScanMatching) {
    sigma = {options.learnt.scan_matching.along.Sigma(0.5), options.learnt.scan_matching.across.Sigma(0.0),
             options.learnt.scan_matching.turn.Sigma(0.4)};
  }
  const Eigen::Vector3d seen = (squares - mean.cwiseAbs2()).cwiseSqrt();
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(mean(k), expected(k), 4.0 * sigma(k) / std::sqrt(count)) << k;
    EXPECT_NEAR(seen(k), sigma(k), 0.03 * sigma(k)) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Models, DpSlamMotion,
                         testing::Values(LowMotion::kGaussian, LowMotion::kEliazar, LowMotion::kScanMatching));

TEST(DpSlam, PicturesTheBestMap) {
  const auto drive = DriveRing(9.0, 7.0, 0.2, 181, 15);
  DpSlam filter(Small(Levels::kFlat), drive[0].T_map_robot, 6);
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
