// The matching table: one number of votes for every pair of a line of the previous scan (row) and one of the current
// scan (column). Also used for the sub-tables of the single criteria. Plain value. Source: thesis A 3.5.1, Table 3.3.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace cairn::slam {

class VoteTable {
 public:
  VoteTable() = default;
  VoteTable(int rows, int columns, double votes = 0.0)
      : rows_(rows),
        columns_(columns),
        votes_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), votes) {}

  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] double& At(int prev, int curr) { return votes_[Index(prev, curr)]; }
  [[nodiscard]] double At(int prev, int curr) const { return votes_[Index(prev, curr)]; }

  void Clear() { std::fill(votes_.begin(), votes_.end(), 0.0); }

  // Adds another table of the same size times its weight (3.5.9).
  void AddWeighted(const VoteTable& other, double weight) {
    for (std::size_t i = 0; i < votes_.size(); ++i) votes_[i] += weight * other.votes_[i];
  }

 private:
  [[nodiscard]] std::size_t Index(int prev, int curr) const {
    return static_cast<std::size_t>(prev) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(curr);
  }

  int rows_ = 0;
  int columns_ = 0;
  std::vector<double> votes_;
};

// A line of the previous scan and the line of the current one taken for the same wall; indices into their lines.
struct LinePair {
  int prev = 0;
  int curr = 0;
  double votes = 0.0;
  bool inlier = false;  // Agrees with the final answer.
};

}  // namespace cairn::slam
