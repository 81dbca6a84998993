#include "server/slam/graph/block_cholesky.h"

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>

namespace cairn::slam {

BlockCholesky::BlockCholesky(std::size_t nodes, std::span<const Edge> edges)
    : place_(nodes), diagonal_(nodes), inverse_(nodes) {
  Order(edges);
  LookWhereBlocksLie(edges);
  below_.resize(row_.size());
  SetZero();
}

void BlockCholesky::Order(std::span<const Edge> edges) {
  std::vector<Eigen::Triplet<char>> entries;
  entries.reserve(2 * edges.size() + place_.size());
  for (const Edge& edge : edges) {
    entries.emplace_back(static_cast<int>(edge.a), static_cast<int>(edge.b), char{1});
    entries.emplace_back(static_cast<int>(edge.b), static_cast<int>(edge.a), char{1});
  }
  const auto nodes = static_cast<int>(place_.size());
  for (int node = 0; node < nodes; ++node) entries.emplace_back(node, node, char{1});
  Eigen::SparseMatrix<char> pattern(nodes, nodes);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  for (int k = 0; k < nodes; ++k) place_[static_cast<std::size_t>(order.indices()[k])] = static_cast<std::uint32_t>(k);
}

// Eliminating a column connects all nodes that it has blocks with. It is enough to hand them to the next one of them.
void BlockCholesky::LookWhereBlocksLie(std::span<const Edge> edges) {
  const std::size_t nodes = place_.size();
  std::vector<std::vector<std::uint32_t>> rows(nodes);
  for (const Edge& edge : edges) {
    const auto [first, second] = std::minmax(place_[edge.a], place_[edge.b]);
    rows[first].push_back(second);
  }
  begin_.assign(1, 0);
  begin_.reserve(nodes + 1);
  for (std::size_t k = 0; k < nodes; ++k) {
    std::vector<std::uint32_t>& column = rows[k];
    std::ranges::sort(column);
    column.erase(std::unique(column.begin(), column.end()), column.end());
    row_.insert(row_.end(), column.begin(), column.end());
    begin_.push_back(row_.size());
    if (column.size() < 2) continue;
    std::vector<std::uint32_t>& next = rows[column.front()];
    next.insert(next.end(), column.begin() + 1, column.end());
  }
  block_of_edge_.reserve(edges.size());
  transposed_.reserve(edges.size());
  for (const Edge& edge : edges) {
    const auto [first, second] = std::minmax(place_[edge.a], place_[edge.b]);
    const auto column = std::span(row_).subspan(begin_[first], begin_[first + 1] - begin_[first]);
    const auto at = static_cast<std::size_t>(std::ranges::lower_bound(column, second) - column.begin());
    block_of_edge_.push_back(begin_[first] + at);
    transposed_.push_back(place_[edge.a] == first ? 1 : 0);
  }
}

void BlockCholesky::SetZero() {
  std::ranges::fill(below_, Eigen::Matrix3d::Zero());
  std::ranges::fill(diagonal_, Eigen::Matrix3d::Zero());
}

void BlockCholesky::AddToDiagonal(std::size_t node, const Eigen::Matrix3d& block) {
  diagonal_[place_[node]] += block;
}

void BlockCholesky::AddToEdge(std::size_t edge, const Eigen::Matrix3d& block) {
  if (transposed_[edge] != 0) {
    below_[block_of_edge_[edge]] += block.transpose();
  } else {
    below_[block_of_edge_[edge]] += block;
  }
}

// L D L' with blocks in D. A column takes up all columns before it that have a block in its row.
bool BlockCholesky::Factorise() {
  constexpr std::uint32_t kNone = UINT32_MAX;
  const std::size_t nodes = place_.size();
  std::vector<std::size_t> at(row_.empty() ? 0 : nodes);  // Per column: the block with which it is taken up next.
  std::vector<std::uint32_t> first(nodes, kNone), next(nodes, kNone);  // Per row: a list of columns that wait for it.
  std::vector<std::size_t> block_in_row(nodes);
  const auto wait = [&](std::uint32_t column, std::size_t block) {
    if (block == begin_[column + 1]) return;
    at[column] = block;
    next[column] = first[row_[block]];
    first[row_[block]] = column;
  };
  for (std::uint32_t k = 0; k < nodes; ++k) {
    for (std::size_t block = begin_[k]; block < begin_[k + 1]; ++block) block_in_row[row_[block]] = block;
    for (std::uint32_t j = first[k]; j != kNone;) {
      const std::uint32_t following = next[j];
      const std::size_t own = at[j];
      const Eigen::Matrix3d D_L = diagonal_[j] * below_[own].transpose();
      diagonal_[k].noalias() -= below_[own] * D_L;
      for (std::size_t block = own + 1; block < begin_[j + 1]; ++block)
        below_[block_in_row[row_[block]]].noalias() -= below_[block] * D_L;
      wait(j, own + 1);
      j = following;
    }
    const Eigen::LLT<Eigen::Matrix3d> factor(diagonal_[k]);
    if (factor.info() != Eigen::Success) return false;
    inverse_[k] = factor.solve(Eigen::Matrix3d::Identity());
    for (std::size_t block = begin_[k]; block < begin_[k + 1]; ++block) {
      const Eigen::Matrix3d unscaled = below_[block];
      below_[block].noalias() = unscaled * inverse_[k];
    }
    wait(k, begin_[k]);
  }
  return true;
}

void BlockCholesky::Solve(std::vector<Eigen::Vector3d>& b) const {
  const std::size_t nodes = place_.size();
  std::vector<Eigen::Vector3d> x(nodes);
  for (std::size_t node = 0; node < nodes; ++node) x[place_[node]] = b[node];
  for (std::size_t k = 0; k < nodes; ++k)
    for (std::size_t block = begin_[k]; block < begin_[k + 1]; ++block)
      x[row_[block]].noalias() -= below_[block] * x[k];
  for (std::size_t k = 0; k < nodes; ++k) x[k] = (inverse_[k] * x[k]).eval();
  for (std::size_t k = nodes; k-- > 0;)
    for (std::size_t block = begin_[k]; block < begin_[k + 1]; ++block)
      x[k].noalias() -= below_[block].transpose() * x[row_[block]];
  for (std::size_t node = 0; node < nodes; ++node) b[node] = x[place_[node]];
}

}  // namespace cairn::slam
