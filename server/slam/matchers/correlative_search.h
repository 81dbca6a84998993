// The search inside the correlative matcher: all motions in the window, coarse blocks first. Source: see
// correlative.h.
#pragma once

#include <Eigen/Cholesky>
#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/matchers/correlative.h"
#include "server/slam/matchers/likelihood_table.h"

namespace cairn::slam {

class CorrelativeSearch {
 public:
  struct Answer {
    Pose2 best;  // The most likely motion evaluated.
    Pose2 mean;  // Mean of the likely motions.
    Eigen::Matrix3d covariance =
        Eigen::Matrix3d::Zero();  // Spread of the likely motions plus the quantisation by the steps.
    bool on_border = false;       // True if `best` lies on the border of the window.
    int tried = 0;                // Number of motions evaluated cell by cell.
  };

  CorrelativeSearch(std::span<const SurfacePoint> reference, std::span<const SurfacePoint> points,
                    const MatchPrior& prior, const CorrelativeOptions& options);

  [[nodiscard]] Answer Run(const ParallelFor& parallel_for) const;

 private:
  struct Block {
    int x = 0, y = 0;    // First shift, in cells from the middle of the window.
    double bound = 0.0;  // Upper bound of the log likelihood of the motions in the block.
  };
  // One turn: the cells of the turned points at the middle of the window, and the blocks of shifts, the most
  // likely first.
  struct Turn {
    double theta = 0.0;
    std::vector<std::int32_t> cells;
    std::vector<Block> blocks;
  };
  struct Motion {
    int turn = 0, x = 0, y = 0;
    double log_likelihood = 0.0;
  };

  [[nodiscard]] Turn Look(int turn) const;
  [[nodiscard]] Pose2 PoseOf(const Turn& turn, int x, int y) const;
  [[nodiscard]] double LogPrior(const Pose2& T) const;
  // Adds every motion of the block that is not less likely than `best` minus the option `likely`. `best`
  // rises as better motions are found.
  void Try(const Turn& turn, int index, const Block& block, double& best, std::vector<Motion>& likely,
           int& tried) const;
  [[nodiscard]] double FromSum(std::int64_t sum) const;

  const CorrelativeOptions& options_;
  const MatchPrior& prior_;
  Eigen::LLT<Eigen::Matrix3d> prior_cholesky_;
  std::vector<Eigen::Vector2d> points_;
  LikelihoodTable table_;
  int turns_ = 0;  // Number of turns to either side.
  int shifts_ = 0;
  double turn_step_ = 0.0;
};

}  // namespace cairn::slam
