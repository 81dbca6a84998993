#include "server/slam/graph/pose_graph.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "server/slam/graph/block_cholesky.h"
#include "server/slam/graph/loop_graph.h"
#include "tests/numerical_derivative.h"

namespace cairn::slam {
namespace {

const Eigen::Matrix3d kStepCovariance = Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();
const Eigen::Matrix3d kLoopCovariance = Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();

// A square of 40 steps: the true steps, and the measured ones, which all turn too far by the same angle.
struct Square {
  std::vector<Pose2> truth, measured;
  std::vector<PoseRelation> relations;

  Square() {
    Pose2 pose{1, 2, 0.5}, drifted = pose;
    truth.push_back(pose), measured.push_back(pose);
    for (std::size_t k = 0; k < 40; ++k) {
      const Pose2 step{0.5, 0.0, k % 10 == 9 ? kPi / 2 : 0.0};
      const Pose2 seen{0.5, 0.0, WrapAngle(step.theta + 0.01)};
      pose = pose * step;
      drifted = drifted * seen;
      truth.push_back(pose), measured.push_back(drifted);
      relations.push_back({k, k + 1, seen, kStepCovariance, false});
    }
  }
  [[nodiscard]] double Error(const std::vector<Pose2>& path) const {
    double worst = 0.0;
    for (std::size_t k = 0; k < path.size(); ++k)
      worst = std::max(worst, (path[k].translation() - truth[k].translation()).norm());
    return worst;
  }
};

TEST(PoseGraph, JacobiansAreTheDerivatives) {
  std::mt19937_64 rng(5);
  std::uniform_real_distribution<double> any(-2.0, 2.0);
  for (int run = 0; run < 20; ++run) {
    const PoseRelation relation{0, 1, {any(rng), any(rng), any(rng)}, kStepCovariance, false};
    const Eigen::Vector3d a(any(rng), any(rng), any(rng));
    // Near the relation, so that the error's angle does not wrap.
    const Pose2 T_map_from{a.x(), a.y(), a.z()};
    const Eigen::Vector3d b = (T_map_from * relation.T_from_to * Pose2{0.3, -0.2, 0.1}).vector();
    const auto error = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
      return ErrorOf(relation, {from.x(), from.y(), from.z()}, {to.x(), to.y(), to.z()}).error;
    };
    const PoseRelationError at = ErrorOf(relation, T_map_from, {b.x(), b.y(), b.z()});
    EXPECT_LT((at.J_error_from - NumericalDerivative<3, 3>([&](const auto& x) { return error(x, b); }, a)).norm(),
              1e-6);
    EXPECT_LT((at.J_error_to - NumericalDerivative<3, 3>([&](const auto& x) { return error(a, x); }, b)).norm(), 1e-6);
  }
}

// Cancelling a job or stopping the server used to wait for the whole fit, which takes minutes on a long path.
TEST(PoseGraph, EndsBetweenTwoIterationsWhereItIsToldTo) {
  Square square;
  square.relations.push_back({0, 40, Between(square.truth[0], square.truth[40]), kStepCovariance, true});
  std::vector<Pose2> path = square.measured;
  int asked = 0;
  const auto told = OptimisePoses(path, square.relations, {}, [&asked] { return ++asked < 3; });
  EXPECT_TRUE(told.cancelled);
  EXPECT_FALSE(told.usable);
  EXPECT_EQ(asked, 3);
  EXPECT_EQ(path, square.measured);
  // A callback that never cancels must not change the result: the same bytes as without it.
  std::vector<Pose2> alone = square.measured;
  EXPECT_FALSE(OptimisePoses(path, square.relations, {}, [] { return true; }).cancelled);
  OptimisePoses(alone, square.relations, {});
  EXPECT_EQ(path, alone);
}

TEST(PoseGraph, AChainIsAlreadyTheBest) {
  const Square square;
  std::vector<Pose2> path = square.measured;
  const PoseGraphSummary summary = OptimisePoses(path, square.relations, {});
  EXPECT_TRUE(summary.usable);
  EXPECT_NEAR(summary.cost_after, 0.0, 1e-12);
  for (std::size_t k = 0; k < path.size(); ++k) EXPECT_NEAR(Between(path[k], square.measured[k]).x, 0.0, 1e-9);
}

TEST(PoseGraph, OneLoopStraightensTheSquare) {
  Square square;
  const double before = square.Error(square.measured);
  EXPECT_GT(before, 0.5);
  square.relations.push_back({0, 40, Between(square.truth[0], square.truth[40]), kLoopCovariance, true});
  std::vector<Pose2> path = square.measured;
  const PoseGraphSummary summary = OptimisePoses(path, square.relations, {});
  ASSERT_TRUE(summary.usable);
  EXPECT_LT(summary.cost_after, summary.cost_before);
  EXPECT_LT(square.Error(path), 0.25 * before);
  EXPECT_EQ(path.front(), square.measured.front());
}

TEST(PoseGraph, WhatIsHeldStaysWhereItIs) {
  Square square;
  square.relations.push_back({0, 40, Between(square.truth[0], square.truth[40]), kLoopCovariance, true});
  std::vector<Pose2> path = square.measured;
  ASSERT_TRUE(OptimisePoses(path, square.relations, {}, {}, 11).usable);
  for (std::size_t k = 0; k < 11; ++k) EXPECT_EQ(path[k], square.measured[k]) << k;
  const auto gap_m = [&](const std::vector<Pose2>& of) {
    return (Between(of[0], of[40]).translation() - Between(square.truth[0], square.truth[40]).translation()).norm();
  };
  EXPECT_LT(gap_m(path), 0.25 * gap_m(square.measured));
  EXPECT_FALSE(OptimisePoses(path, square.relations, {}, {}, path.size()).usable) << "nothing may move";
}

TEST(PoseGraph, AWrongLoopIsOutvoted) {
  Square square;
  for (const std::size_t k : {36U, 37U, 38U, 39U, 40U})
    square.relations.push_back({40 - k, k, Between(square.truth[40 - k], square.truth[k]), kLoopCovariance, true});
  std::vector<Pose2> right = square.measured;
  ASSERT_TRUE(OptimisePoses(right, square.relations, {}).usable);
  square.relations.push_back(
      {5, 25, {0.0, 0.0, 0.0}, kLoopCovariance, true});  // Two places 7 m apart are one, it says.
  std::vector<Pose2> path = square.measured;
  ASSERT_TRUE(OptimisePoses(path, square.relations, {}).usable);
  EXPECT_LT(square.Error(path), square.Error(right) + 0.3);
}

// Runs of steps without loops are fitted as one relation each, and then every step takes its share.
TEST(LoopGraph, IsTheSameFitAsThatOfAllNodes) {
  Square square;
  for (std::size_t k = 0; k < square.relations.size(); ++k)  // Some steps are less certain than others.
    square.relations[k].covariance *= k % 7 == 3 ? 20.0 : 1.0;
  square.relations.push_back({0, 40, Between(square.truth[0], square.truth[40]), kLoopCovariance, true});
  square.relations.push_back({3, 38, Between(square.truth[3], square.truth[38]), kLoopCovariance, true});
  square.relations.push_back({9, 31, Between(square.truth[9], square.truth[31]), kLoopCovariance, true});
  std::vector<Pose2> all = square.measured, ends = square.measured;
  ASSERT_TRUE(OptimisePoses(all, square.relations, {}).usable);
  ASSERT_TRUE(OptimiseLoopGraph(ends, square.relations, {}).usable);
  EXPECT_GT(square.Error(square.measured), 0.5);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Pose2 apart = Between(all[k], ends[k]);
    EXPECT_LT(apart.translation().norm(), 0.01) << k;
    EXPECT_LT(std::abs(apart.theta), 0.002) << k;
  }
  EXPECT_EQ(ends.front(), square.measured.front());
}

// A wrong loop reaches far at first, and the fit must let go of it as that of all nodes does.
TEST(LoopGraph, OutvotesAWrongLoopAsTheFitOfAllNodesDoes) {
  Square square;
  for (const std::size_t k : {36U, 37U, 38U, 39U, 40U})
    square.relations.push_back({40 - k, k, Between(square.truth[40 - k], square.truth[k]), kLoopCovariance, true});
  square.relations.push_back({5, 25, {0.0, 0.0, 0.0}, kLoopCovariance, true});
  std::vector<Pose2> all = square.measured, ends = square.measured;
  const PoseGraphSummary of_all = OptimisePoses(all, square.relations, {});
  const PoseGraphSummary of_ends = OptimiseLoopGraph(ends, square.relations, {});
  ASSERT_TRUE(of_all.usable && of_ends.usable);
  EXPECT_NEAR(of_ends.cost_after, of_all.cost_after, 0.01 * of_all.cost_after);
  for (std::size_t k = 0; k < all.size(); ++k) EXPECT_LT(Between(all[k], ends[k]).translation().norm(), 0.02) << k;
}

// The result is that of a dense solution, whatever the order of elimination and wherever blocks appear in between.
TEST(BlockCholesky, SolvesAsADenseMatrixDoes) {
  constexpr std::size_t kNodes = 25;
  std::mt19937_64 rng(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  std::uniform_int_distribution<std::uint32_t> node(0, kNodes - 1);
  std::vector<BlockCholesky::Edge> edges;
  for (std::uint32_t k = 1; k < kNodes; ++k) edges.push_back({k - 1, k});
  for (int i = 0; i < 20; ++i)
    if (const BlockCholesky::Edge edge{node(rng), node(rng)}; edge.a != edge.b) edges.push_back(edge);
  edges.push_back({edges.back().b, edges.back().a});  // The same block from the other side.
  BlockCholesky sparse(kNodes, edges);
  for (int round = 0; round < 2; ++round) {  // With other numbers at the same places.
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(3 * kNodes, 3 * kNodes);
    sparse.SetZero();
    const auto random = [&] { return Eigen::Matrix3d::NullaryExpr([&] { return any(rng); }).eval(); };
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const Eigen::Matrix3d J_a = random(), J_b = random() + 3.0 * Eigen::Matrix3d::Identity();
      const auto a = 3 * static_cast<Eigen::Index>(edges[i].a), b = 3 * static_cast<Eigen::Index>(edges[i].b);
      sparse.AddToDiagonal(edges[i].a, J_a.transpose() * J_a);
      sparse.AddToDiagonal(edges[i].b, J_b.transpose() * J_b);
      sparse.AddToEdge(i, J_a.transpose() * J_b);
      dense.block<3, 3>(a, a) += J_a.transpose() * J_a;
      dense.block<3, 3>(b, b) += J_b.transpose() * J_b;
      dense.block<3, 3>(a, b) += J_a.transpose() * J_b;
      dense.block<3, 3>(b, a) += J_b.transpose() * J_a;
    }
    sparse.AddToDiagonal(0, Eigen::Matrix3d::Identity());
    dense.topLeftCorner<3, 3>() += Eigen::Matrix3d::Identity();
    std::vector<Eigen::Vector3d> x(kNodes);
    Eigen::VectorXd b(3 * kNodes);
    for (std::size_t k = 0; k < kNodes; ++k) {
      x[k] = Eigen::Vector3d::NullaryExpr([&] { return any(rng); });
      b.segment<3>(3 * static_cast<Eigen::Index>(k)) = x[k];
    }
    ASSERT_TRUE(sparse.Factorise());
    sparse.Solve(x);
    const Eigen::VectorXd expected = dense.ldlt().solve(b);
    for (std::size_t k = 0; k < kNodes; ++k)
      EXPECT_LT((x[k] - expected.segment<3>(3 * static_cast<Eigen::Index>(k))).norm(), 1e-8) << k;
  }
}

TEST(BlockCholesky, SaysThatAMatrixIsNotPositiveDefinite) {
  const std::vector<BlockCholesky::Edge> edges = {{0, 1}};
  BlockCholesky matrix(2, edges);
  matrix.AddToDiagonal(0, Eigen::Matrix3d::Identity());
  matrix.AddToDiagonal(1, Eigen::Matrix3d::Identity());
  matrix.AddToEdge(0, 2.0 * Eigen::Matrix3d::Identity());
  EXPECT_FALSE(matrix.Factorise());
}

// A long chain with few loops must stay nearly as sparse as it is: otherwise a large loop takes seconds.
TEST(BlockCholesky, FillsInLittle) {
  constexpr std::uint32_t kNodes = 3000;
  std::vector<BlockCholesky::Edge> edges;
  for (std::uint32_t k = 1; k < kNodes; ++k) edges.push_back({k - 1, k});
  for (std::uint32_t k = 0; k + 1500 < kNodes; k += 5) edges.push_back({k, k + 1500});
  EXPECT_LT(BlockCholesky(kNodes, edges).factor_blocks(), 3 * edges.size());
}

TEST(LoopGraph, LeavesAPathThatCannotBeFitted) {
  std::vector<Pose2> path = {{1, 2, 3}};
  EXPECT_FALSE(OptimiseLoopGraph(path, {}, {}).usable);
  EXPECT_EQ(path.front(), (Pose2{1, 2, 3}));
}

TEST(PoseGraph, TurningTheWholeProblemTurnsTheAnswer) {
  Square square;
  square.relations.push_back({0, 40, Between(square.truth[0], square.truth[40]), kLoopCovariance, true});
  std::vector<Pose2> path = square.measured, turned;
  const Pose2 T{-3, 4, 2.5};
  for (const Pose2& pose : path) turned.push_back(T * pose);
  ASSERT_TRUE(OptimisePoses(path, square.relations, {}).usable);
  ASSERT_TRUE(OptimisePoses(turned, square.relations, {}).usable);
  for (std::size_t k = 0; k < path.size(); ++k)
    EXPECT_LT(Between(T * path[k], turned[k]).translation().norm(), 1e-3) << k;
}

TEST(PoseGraph, NothingToDoIsNoImprovement) {
  std::vector<Pose2> path = {{1, 2, 3}};
  EXPECT_FALSE(OptimisePoses(path, {}, {}).usable);
  EXPECT_EQ(path.front(), (Pose2{1, 2, 3}));
}

}  // namespace
}  // namespace cairn::slam
