#include "server/slam/graph/path_fit.h"

#include <gtest/gtest.h>

#include <random>

#include "server/slam/random/draws.h"
#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

// Two rounds of a square of 40 m sides whose measured steps turn too far, with revisits on the second round, some of
// which are wrong, and a loop that closes it.
struct Rounds {
  std::vector<Pose2> measured;
  std::vector<PoseRelation> relations;
  PoseRelation loop;

  explicit Rounds(std::uint64_t seed) {
    Rng rng(seed);
    const Eigen::Matrix3d step_covariance = Eigen::Vector3d(4e-4, 4e-4, 1e-5).asDiagonal();
    const Eigen::Matrix3d loop_covariance = Eigen::Vector3d(0.01, 0.01, 1e-4).asDiagonal();
    std::vector<Pose2> truth{{3, -2, 0.4}};
    measured = truth;
    for (std::size_t k = 0; k < 640; ++k) {
      const Pose2 step{0.5, 0.0, k % 80 == 79 ? kPi / 2 : 0.0};
      const Eigen::Vector3d noise = ThreeNormalDraws(rng);
      const Pose2 seen{0.5 + 0.02 * noise.x(), 0.02 * noise.y(), WrapAngle(step.theta + 0.003 * noise.z() + 0.0005)};
      truth.push_back(truth.back() * step);
      measured.push_back(measured.back() * seen);
      relations.push_back({k, k + 1, seen, step_covariance, false});
    }
    for (std::size_t k = 480; k < 600; k += 7) {
      const Pose2 wrong = k % 5 == 0 ? Pose2{3.0, -2.0, 0.4} : Pose2{};
      relations.push_back({k - 320, k, Between(truth[k - 320], truth[k]) * wrong, loop_covariance, true});
    }
    loop = {10, 330, Between(truth[10], truth[330]), loop_covariance, true};
  }
};

double Farthest(const std::vector<Pose2>& a, const std::vector<Pose2>& b) {
  double farthest = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k)
    farthest = std::max(farthest, (a[k].translation() - b[k].translation()).norm());
  return farthest;
}

TEST(PathFit, InPartsThePathIsThatOfTheLeastSquaresAtOnce) {
  const PoseGraphOptions exact{.max_iterations = 100, .tolerance = 1e-10};
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    const Rounds rounds(seed);
    std::vector<PoseRelation> all = rounds.relations;
    all.push_back(rounds.loop);
    std::vector<Pose2> at_once = rounds.measured;
    ASSERT_TRUE(OptimisePoses(at_once, all, exact).usable);
    EXPECT_GT(Farthest(at_once, rounds.measured), 1.0) << "the loop must be worth a fit";
    PathFit fit(rounds.measured, rounds.relations, rounds.loop);
    std::vector<PoseRelation> later = rounds.relations;
    int parts = 0;
    for (; !fit.done(); ++parts) {
      fit.GoOn(later, exact, 1);
      later.push_back({0, 640, {}, Eigen::Matrix3d::Identity(), true});  // What comes later takes no part.
    }
    EXPECT_GT(parts, 10);
    ASSERT_TRUE(fit.usable());
    EXPECT_LT(Farthest(fit.path(), at_once), 1e-3) << seed;
  }
}

TEST(PathFit, GoesOnFromAnyPartAsIfItHadNotBeenSaved) {
  const Rounds rounds(1);
  PathFit whole(rounds.measured, rounds.relations, rounds.loop);
  int parts = 0;
  for (; !whole.done(); ++parts) whole.GoOn(rounds.relations, {}, 1);
  for (int before = 0; before < parts; ++before) {
    PathFit first(rounds.measured, rounds.relations, rounds.loop), second;
    for (int i = 0; i < before; ++i) first.GoOn(rounds.relations, {}, 1);
    StateWriter writer;
    writer(first);
    const std::string bytes = writer.Bytes();
    StateReader reader(bytes);
    reader.SetKeyframes(rounds.measured.size());
    reader(second);
    ASSERT_TRUE(reader.done());
    ASSERT_TRUE(second.IsConsistent(rounds.relations, rounds.measured.size()));
    int after = 0;
    for (; !second.done(); ++after) second.GoOn(rounds.relations, {}, 1);
    EXPECT_EQ(before + after, parts);
    EXPECT_EQ(second.path(), whole.path());
  }
}

}  // namespace
}  // namespace cairn::slam
