// The search inside the correlative matcher: all motions in the window, coarse blocks first. Source: see correlative.h.
#pragma once

#include <Eigen/Cholesky>
#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/matching/correlative.h"
#include "server/slam/matching/likelihood_table.h"

namespace cairn::slam {

class CorrelativeSearch {
 public:
  struct Answer {
    Pose2 best;                                            // The likeliest motion tried.
    Pose2 mean;                                            // Over the likely ones.
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // Their spread and what the steps leave.
    bool on_border = false;                                // `best` is at the end of the window.
    int tried = 0;                                         // Motions scored cell by cell.
  };

  CorrelativeSearch(std::span<const SurfacePoint> reference, std::span<const SurfacePoint> points,
                    const MatchPrior& prior, const CorrelativeOptions& options);

  [[nodiscard]] Answer Run(const ParallelFor& parallel_for) const;

 private:
  struct Block {
    int x = 0, y = 0;    // First shift, in cells from the window's middle.
    double bound = 0.0;  // No motion in it is likelier.
  };
  // One turn: its points' cells at the middle of the window, its blocks, the likeliest first.
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
  // Every motion of the block not less likely than `least`, which rises as better ones are found: best - likely.
  void Try(const Turn& turn, int index, const Block& block, double& best, std::vector<Motion>& likely,
           int& tried) const;
  [[nodiscard]] double FromSum(std::int64_t sum) const;

  const CorrelativeOptions& options_;
  const MatchPrior& prior_;
  Eigen::LLT<Eigen::Matrix3d> prior_cholesky_;
  std::vector<Eigen::Vector2d> points_;
  LikelihoodTable table_;
  int turns_ = 0;  // Either way.
  int shifts_ = 0;
  double turn_step_ = 0.0;
};

}  // namespace cairn::slam
