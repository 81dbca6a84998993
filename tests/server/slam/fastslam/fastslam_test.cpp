#include "server/slam/fastslam/fastslam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "common/geometry/rotated_covariance.h"
#include "server/slam/landmark_variants/landmark_oriented.h"
#include "server/slam/landmark_variants/landmark_point.h"
#include "server/slam/landmarks/landmark_pair.h"
#include "server/slam/motion_models/motion_sampling.h"

namespace cairn::slam {
namespace {

constexpr std::int64_t kParticles = 100;

BackEndOptions Wide() {
  BackEndOptions options;
  options.drift = {0.0, 0.05, 0.0, 0.0, 0.02, 0.0};
  options.landmarks.min_travel_m = 0.0;
  return options;
}

// The noise of FastSLAM 1.0 that corresponds to Wide().
MotionSampler Sampler() {
  MotionSampling sampling;
  sampling.alpha_v_v = 0.0025;
  sampling.alpha_g_v = sampling.alpha_w_v = 0.0002;
  sampling.alpha_g_w = sampling.alpha_w_w = 0.0;
  return {.input = [](const StepMotion& step) { return step; },
          .draw = [sampling](const Pose2& T_map_robot, const StepMotion& step,
                             Rng& rng) { return SampleMotion(T_map_robot, step, sampling, rng); }};
}

template <typename Model>
struct Make {
  static FastSlam<Model> Filter(std::uint64_t seed, BackEndOptions options = Wide()) {
    return {{}, options, kParticles, {}, seed, std::is_same_v<Model, LandmarkPoint> ? Sampler() : MotionSampler{}};
  }
};

// Of the standard deviations of (x, y, theta) as they spread after a step with this covariance.
Eigen::Vector3d SpreadDrawn(const FastSlamOptions& options, const Eigen::Matrix3d& covariance) {
  constexpr int kMany = 20000;
  ParticleSet set(options, kMany, {}, 1);
  set.Predict({1.0, 0.0, 0.0}, covariance);
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < kMany; ++i) {
    set.Sample(i);
    EXPECT_TRUE(set[i].covariance.isZero());
    const Pose2& pose = set[i].T_map_robot;
    squares += Eigen::Vector3d(pose.x - 1.0, pose.y, pose.theta).cwiseAbs2();
  }
  return (squares / kMany).cwiseSqrt();
}

TEST(ParticleSet, DrawsTheToldShareOfTheNoise) {
  const Eigen::Vector3d sigma(0.2, 0.1, 0.05);
  const Eigen::Matrix3d covariance = sigma.cwiseAbs2().asDiagonal();
  for (const double share : {1.0, 0.5}) {
    const Eigen::Vector3d spread = SpreadDrawn({.drawn_share = share}, covariance);
    EXPECT_LT((spread.cwiseQuotient(share * sigma) - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff(), 0.05) << share;
  }
}

// All particles but one are at one place, and the doubt has been found to be small. The one far away has a path that is
// eight times as likely as that of each other, but together they weigh twelve times as much. The pose was that one.
TEST(ParticleSet, ThePoseIsWhereTheWeightIs) {
  ParticleSet set({.sample_distance_m = 1e9}, kParticles, {}, 1);
  ASSERT_TRUE(set.Commit().empty());
  set.Predict({1.0, 0.0, 0.0}, 9.0 * Eigen::Matrix3d::Identity());
  set.Sample(7);
  ASSERT_GT((set[7].T_map_robot.translation() - Eigen::Vector2d(1.0, 0.0)).norm(), 1.0);
  set.Constrain<3>(0, {Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity(), 1e-4 * Eigen::Matrix3d::Identity()});
  set.AddLogLikelihood(7, std::log(8.0));
  ASSERT_TRUE(set.Commit().empty());
  EXPECT_LT((set.estimate().T_map_robot.translation() - Eigen::Vector2d(1.0, 0.0)).norm(), 1e-9);
  EXPECT_NE(set.best_index(), 7U);
}

// Where no place has more than twice the weight of another one, the likeliest path counts, so that the pose does not
// change between them with every resampling.
TEST(ParticleSet, OfTwoPlacesOfAboutTheSameWeightThePoseIsThatOfTheLikeliestPath) {
  ParticleSet set({.sample_distance_m = 1e9}, 3, {}, 1);
  ASSERT_TRUE(set.Commit().empty());
  set.Predict({1.0, 0.0, 0.0}, 9.0 * Eigen::Matrix3d::Identity());
  set.Sample(2);
  const Pose2 apart = set[2].T_map_robot;
  ASSERT_GT((apart.translation() - Eigen::Vector2d(1.0, 0.0)).norm(), 1.0);
  set.Constrain<3>(0, {Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity(), 1e-4 * Eigen::Matrix3d::Identity()});
  set.AddLogLikelihood(2, 0.1);
  ASSERT_TRUE(set.Commit().empty());
  EXPECT_EQ(set.estimate().T_map_robot, apart);
}

template <typename Model>
class FastSlamVariants : public testing::Test {};
using Models = testing::Types<LandmarkPair, LandmarkOriented, LandmarkPoint>;
TYPED_TEST_SUITE(FastSlamVariants, Models);

// Ten metres out, a turn, and ten metres back. The true end is the start, facing back.
void DriveOutAndBack(Filter& filter) {
  const auto step = [&](const Pose2& T_prev_curr) {
    filter.Predict({T_prev_curr});
    filter.Commit();
  };
  filter.Commit();
  for (int i = 0; i < 20; ++i) step({0.5, 0, 0});
  step({0, 0, kPi});
  for (int i = 0; i < 20; ++i) step({0.5, 0, 0});
}

TYPED_TEST(FastSlamVariants, UncertaintyGrowsAlongThePathAndARevisitTakesItAway) {
  auto filter = Make<TypeParam>::Filter(1);
  DriveOutAndBack(filter);
  const double before = filter.estimate().covariance.template topLeftCorner<2, 2>().trace();
  const RevisitObservation revisit{0, {0, 0, kPi}, Eigen::Vector3d(0.0025, 0.0025, 0.0004).asDiagonal()};
  for (int i = 0; i < 5; ++i) {
    filter.Predict({{0, 0, 0}});
    ASSERT_TRUE(filter.Observe(revisit));
    filter.Commit();
  }
  EXPECT_LT((filter.estimate().covariance.template topLeftCorner<2, 2>().trace()), 0.3 * before);
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.2);
}

// Matches on the same metres have the same errors. Ten of them made the stated doubt as small as if each one had its
// own, and it was smaller than the error.
TYPED_TEST(FastSlamVariants, RevisitsThatAreAlikeTakeAwayLessDoubtAndMoveThePoseAsMuch) {
  const auto drive = [](bool alike) {
    auto filter = Make<TypeParam>::Filter(1);
    DriveOutAndBack(filter);
    for (std::size_t i = 0; i < 10; ++i) {
      filter.Predict({{0, 0, 0}});
      EXPECT_TRUE(filter.Observe(
          {0, {0, 0, kPi}, Eigen::Vector3d(0.01, 0.01, 0.0004).asDiagonal(), alike ? i : std::size_t{0}}));
      filter.Commit();
    }
    return filter.estimate();
  };
  const FilterEstimate alike = drive(true), apart = drive(false);
  EXPECT_EQ(alike.T_map_robot, apart.T_map_robot);
  const auto doubt = [](const FilterEstimate& estimate) {
    return estimate.covariance.template topLeftCorner<2, 2>().trace();
  };
  // Ten of a standard deviation of 0.1 m say as much as one of 0.03 m; one after the other, as 1 + 1/2 + ... + 1/10
  // = 2.9.
  EXPECT_GT(doubt(alike), 2.0 * doubt(apart));
  EXPECT_LT(doubt(alike), 0.02);
}

TYPED_TEST(FastSlamVariants, ARevisitNoParticleExplainsChangesNothingAndManyMeanDiverged) {
  auto filter = Make<TypeParam>::Filter(1);
  DriveOutAndBack(filter);
  const Pose2 before = filter.particles().best().T_map_robot;
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(filter.health().diverged);
    EXPECT_FALSE(filter.Observe({0, {50, 0, 0}, Eigen::Matrix3d::Identity() * 1e-4}));
  }
  EXPECT_EQ(filter.particles().best().T_map_robot, before);
  EXPECT_TRUE(filter.health().diverged);
  EXPECT_TRUE(filter.Observe({0, Between({}, before), Eigen::Matrix3d::Identity() * 0.01}));
  EXPECT_FALSE(filter.health().diverged) << "explained again";
}

// Two corners as the robot sees them from T_map_robot, exactly.
std::vector<LandmarkSighting> TwoCorners(const Pose2& T_map_robot, std::size_t first_slot = 0) {
  const Pose2 T_robot_map = T_map_robot.Inverse();
  return {{first_slot, {true, 1.5}, T_robot_map * Eigen::Vector2d(2.0, 1.0), WrapAngle(0.3 - T_map_robot.theta)},
          {first_slot + 1, {true, -1.5}, T_robot_map * Eigen::Vector2d(1.0, -2.0), WrapAngle(1.2 - T_map_robot.theta)}};
}

TYPED_TEST(FastSlamVariants, LandmarksSeenAgainPullTheRobotBack) {
  auto filter = Make<TypeParam>::Filter(3);
  filter.Observe(TwoCorners({}), 0.0);
  filter.Commit();
  ASSERT_EQ(filter.landmarks().size(), 2U);
  // The motion is uncertain by half a metre forwards and back; the landmarks remove this spread.
  double spread = 0.0;
  for (int i = 1; i <= 8; ++i) {
    for (const double step : {1.0, -1.0, 1.0, -1.0}) filter.Predict({{step, 0, 0}});
    filter.Observe(std::vector<LandmarkSighting>{}, i);
    filter.Commit();
    if (i == 4) spread = filter.estimate().covariance.template topLeftCorner<2, 2>().trace();
    if (i < 4) continue;
    filter.Observe(TwoCorners({}), i);
    filter.Commit();
  }
  EXPECT_LT((filter.estimate().covariance.template topLeftCorner<2, 2>().trace()), 0.7 * spread);
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.15);
  EXPECT_EQ(filter.landmarks().size(), 2U) << "seen again, not new";
  EXPECT_GT(filter.landmarks()[0].sightings, 3U);
}

// Landmarks that were first seen from a retired keyframe move with its representative.
TYPED_TEST(FastSlamVariants, RetiredKeyframesLeaveAllPathsAndTheirLandmarksStay) {
  auto filter = Make<TypeParam>::Filter(3);
  for (int i = 0; i < 6; ++i) {
    if (i > 0) filter.Predict({{0.5, 0, 0}});
    if (i == 2) filter.Observe(TwoCorners({1.0, 0, 0}), 1.0);
    filter.Commit();
  }
  ASSERT_EQ(filter.landmarks().size(), 2U);
  const PosePath before = filter.hypothesis(0).path;
  const Eigen::Vector2d landmark = filter.landmarks().front().p_map;
  ASSERT_TRUE(filter.retires());
  filter.Retire({.kept = {0, 3, 4, 5},
                 .representative = {0, 3, 3, 3, 4, 5},
                 .index_after = {0, 1, 1, 1, 2, 3},
                 .T_representative_keyframe = {}});
  for (std::size_t i = 0; i < filter.hypothesis_count(); ++i) ASSERT_EQ(filter.hypothesis(i).path.size(), 4U);
  EXPECT_EQ(filter.hypothesis(0).path[1], before[3]);
  EXPECT_EQ(filter.hypothesis(0).path[3], before[5]);
  std::vector<Pose2> path = filter.hypothesis(0).path.values();
  const Pose2 T_new_old{3, -2, 0.5};
  path[1] = T_new_old * path[1];
  filter.Rebase(path);
  EXPECT_LT((filter.landmarks().front().p_map - T_new_old * landmark).norm(), 1e-9);
  EXPECT_TRUE(filter.Observe({1, Between(path[1], path[3]), Eigen::Matrix3d::Identity()}));
}

// All particles and all that they have seen move with the best one, and none is forgotten.
TYPED_TEST(FastSlamVariants, AMovedPathTakesEveryParticleAlong) {
  auto filter = Make<TypeParam>::Filter(3), moved = Make<TypeParam>::Filter(3);
  const auto drive = [](auto& one) {
    for (int i = 0; i < 12; ++i) {
      if (i > 0) one.Predict({{i % 2 == 0 ? 1.0 : -1.0, 0, 0}});
      if (i == 2) one.Observe(TwoCorners({1.0, 0, 0}), 1.0);
      one.Commit();
    }
  };
  drive(filter);
  drive(moved);
  const Pose2 T_new_old{3, -2, 0.5};
  std::vector<Pose2> path = filter.hypothesis(0).path.values();
  const std::size_t first_seen_from = 2;
  for (std::size_t k = 0; k < path.size(); ++k) path[k] = T_new_old * path[k];
  moved.MoveTo(path);
  EXPECT_EQ(moved.hypothesis(0).path.values(), path);
  std::set<double> different;
  for (std::size_t i = 0; i < filter.hypothesis_count(); ++i) {
    const auto was = filter.hypothesis(i), is = moved.hypothesis(i);
    EXPECT_LT((is.T_map_robot.translation() - (T_new_old * was.T_map_robot).translation()).norm(), 1e-9);
    EXPECT_LT((is.path[first_seen_from].translation() - (T_new_old * was.path[first_seen_from]).translation()).norm(),
              1e-9);
    EXPECT_EQ(is.path[is.path.size() - 1], is.T_map_robot);
    different.insert(is.T_map_robot.x);
  }
  EXPECT_GT(different.size(), 5U);
  ASSERT_EQ(moved.landmarks().size(), 2U);
  EXPECT_LT((moved.landmarks()[0].p_map - T_new_old * filter.landmarks()[0].p_map).norm(), 1e-9);
  const auto was = filter.estimate(), is = moved.estimate();
  EXPECT_LT((is.T_map_robot.translation() - (T_new_old * was.T_map_robot).translation()).norm(), 1e-9);
  EXPECT_LT((is.covariance - Rotated(was.covariance, T_new_old.theta)).norm(), 1e-9);
  // It goes on as sure as before.
  filter.Predict({{1.0, 0, 0}});
  moved.Predict({{1.0, 0, 0}});
  filter.Commit();
  moved.Commit();
  EXPECT_LT((moved.estimate().covariance - Rotated(filter.estimate().covariance, T_new_old.theta)).norm(),
            0.3 * filter.estimate().covariance.norm());
}

// A landmark moves with the keyframe from which it was first seen.
TYPED_TEST(FastSlamVariants, ABentPathMovesLandmarksWithTheirKeyframes) {
  auto filter = Make<TypeParam>::Filter(3);
  for (int i = 0; i < 6; ++i) {
    if (i > 0) filter.Predict({{0.5, 0, 0}});
    if (i == 2) filter.Observe(TwoCorners({1.0, 0, 0}), 1.0);
    filter.Commit();
  }
  const Eigen::Vector2d before = filter.landmarks().front().p_map;
  std::vector<Pose2> path = filter.hypothesis(0).path.values();
  const Pose2 T_new_old{0.3, -0.2, 0.1};
  path[2] = T_new_old * path[2];
  filter.MoveTo(path);
  EXPECT_LT((filter.landmarks().front().p_map - T_new_old * before).norm(), 1e-9);
  EXPECT_EQ(filter.hypothesis(0).T_map_robot, path.back());
}

// Before a place is seen again all particles are about as likely. The pose was that of the particles near one of them,
// which was as far from the steps driven as the doubt allows, and jumped when another one became the most likely.
TYPED_TEST(FastSlamVariants, AsLongAsNothingSpeaksForOneParticleThePoseIsInTheMiddleOfAll) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    auto filter = Make<TypeParam>::Filter(seed);
    for (int i = 0; i < 120; ++i) {
      if (i > 0) filter.Predict({{0.5, 0, 0}});
      filter.Commit();
    }
    const FilterEstimate estimate = filter.estimate();
    const double doubt_m = std::sqrt(estimate.covariance.template topLeftCorner<2, 2>().trace());
    ASSERT_GT(doubt_m, 2.0);
    const double error_m = (estimate.T_map_robot.translation() - Eigen::Vector2d(59.5, 0.0)).norm();
    EXPECT_LT(error_m, 0.35 * doubt_m) << "seed " << seed;
    const double beside_m = Between(estimate.T_map_robot, filter.hypothesis(0).T_map_robot).translation().norm();
    EXPECT_LT(beside_m, 0.35 * doubt_m) << "seed " << seed << ", the path that is believed";
  }
}

TYPED_TEST(FastSlamVariants, EveryParticleDecidesForItselfWhatItSees) {
  // Particles spread over metres see a corner of another slot, and only some of them have a landmark there.
  auto filter = Make<TypeParam>::Filter(5);
  filter.Observe(TwoCorners({}), 0.0);
  filter.Commit();
  for (int i = 0; i < 40; ++i) {
    filter.Predict({{i % 2 == 0 ? 2.0 : -2.0, 0, 0}});
    filter.Commit();
  }
  filter.Observe(TwoCorners({0.5, 0, 0}, 2), 50.0);
  std::size_t knew = 0, found_new = 0;
  for (std::size_t i = 0; i < filter.particles().size(); ++i) {
    knew += filter.LandmarkCount(i) == 2 ? 1 : 0;
    found_new += filter.LandmarkCount(i) == 4 ? 1 : 0;
  }
  EXPECT_GT(knew, 10U);
  EXPECT_GT(found_new, 10U);
  filter.Commit();
}

TYPED_TEST(FastSlamVariants, ALandmarkInViewCountsOnce) {
  BackEndOptions options = Wide();
  options.landmarks.min_travel_m = 5.0;
  auto filter = Make<TypeParam>::Filter(7, options);
  for (const double travelled : {0.0, 1.0, 4.9, 5.1, 6.0}) {
    filter.Observe(TwoCorners({}), travelled);
    filter.Commit();
  }
  ASSERT_EQ(filter.landmarks().size(), 2U);
  EXPECT_EQ(filter.landmarks()[0].sightings, 2U);
}

TYPED_TEST(FastSlamVariants, OneLandmarkIsNotTwoFeaturesOfOneScan) {
  auto filter = Make<TypeParam>::Filter(9);
  filter.Observe(TwoCorners({}), 0.0);
  filter.Commit();
  std::vector<LandmarkSighting> twice = TwoCorners({});
  twice.push_back(twice[0]);
  twice.back().slot = 2;
  filter.Observe(twice, 10.0);
  filter.Commit();
  EXPECT_EQ(filter.landmarks()[0].sightings, 2U);
  EXPECT_EQ(filter.landmarks().size(), 2U);
}

TYPED_TEST(FastSlamVariants, SameSeedSameParticles) {
  auto a = Make<TypeParam>::Filter(42), b = Make<TypeParam>::Filter(42);
  DriveOutAndBack(a);
  DriveOutAndBack(b);
  for (std::size_t i = 0; i < a.particles().size(); ++i)
    ASSERT_EQ(a.particles()[i].T_map_robot, b.particles()[i].T_map_robot);
}

TYPED_TEST(FastSlamVariants, EveryParticleKeepsItsWholePath) {
  auto filter = Make<TypeParam>::Filter(5);
  DriveOutAndBack(filter);
  for (const Particle& particle : filter.particles().particles()) {
    ASSERT_EQ(particle.path.size(), 42U);
    EXPECT_EQ(particle.path[0], Pose2{});
  }
}

TYPED_TEST(FastSlamVariants, StandsAnEmptyScan) {
  auto filter = Make<TypeParam>::Filter(5);
  const Scan scan;
  const ScanView view;
  filter.Observe({scan, view, {}, 0.0}, SerialFor);
  filter.Commit();
  EXPECT_TRUE(filter.landmarks().empty());
  EXPECT_EQ(filter.estimate().T_map_robot, Pose2{});
}

}  // namespace
}  // namespace cairn::slam
