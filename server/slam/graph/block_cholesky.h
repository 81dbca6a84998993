// Solves systems of equations with a symmetric positive definite matrix of 3 x 3 blocks, most of which are zero, as the
// normal equations of a graph of poses have them. Where blocks lie is looked at once, and then matrices with other
// numbers at the same places are solved. Not thread-safe. Deterministic: all sums have one order.
// Source: George and Liu 1981 (sparse factorisation, left-looking); the order of elimination is the approximate minimum
// degree of Amestoy, Davis and Duff 1996, as Eigen implements it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn::slam {

class BlockCholesky {
 public:
  // Two nodes between which the matrix has a block.
  struct Edge {
    std::uint32_t a = 0;
    std::uint32_t b = 0;
  };

  // The matrix is zero at first. Two edges between the same nodes share their block. REQUIRES: a != b, both < nodes.
  BlockCholesky(std::size_t nodes, std::span<const Edge> edges);

  void SetZero();
  void AddToDiagonal(std::size_t node, const Eigen::Matrix3d& block);
  // Adds the block in the rows of the edge's node a and the columns of its node b, and its transpose on the other side.
  void AddToEdge(std::size_t edge, const Eigen::Matrix3d& block);
  // Factorises the matrix, in its place. False if it is not positive definite; then it has to be set again.
  [[nodiscard]] bool Factorise();
  // Replaces `b` (one part per node) by the solution. REQUIRES: Factorise was successful.
  void Solve(std::vector<Eigen::Vector3d>& b) const;
  // How many blocks the factor has below its diagonal.
  [[nodiscard]] std::size_t factor_blocks() const { return row_.size(); }

 private:
  void Order(std::span<const Edge> edges);
  void LookWhereBlocksLie(std::span<const Edge> edges);

  std::vector<std::uint32_t> place_;  // The place of each node in the order of elimination.
  // The factor by columns: those below the diagonal have the rows row_[begin_[k]] to row_[begin_[k + 1] - 1], rising.
  std::vector<std::size_t> begin_;
  std::vector<std::uint32_t> row_;
  std::vector<std::size_t> block_of_edge_;
  std::vector<char> transposed_;  // Per edge: whether its node a is eliminated first.
  std::vector<Eigen::Matrix3d> below_, diagonal_, inverse_;
};

}  // namespace cairn::slam
