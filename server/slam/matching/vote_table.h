// The matching table: the number of votes for every pair of a line of the reference scan (row) and a line of
// the current scan (column). The sub-tables of the single criteria have the same type. Plain value. Source:
// thesis A 3.5.1, Table 3.3.
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
  [[nodiscard]] double& At(int ref, int curr) { return votes_[Index(ref, curr)]; }
  [[nodiscard]] double At(int ref, int curr) const { return votes_[Index(ref, curr)]; }

  void Clear() { std::fill(votes_.begin(), votes_.end(), 0.0); }

  // Adds another table of the same size times its weight (3.5.9).
  void AddWeighted(const VoteTable& other, double weight) {
    for (std::size_t i = 0; i < votes_.size(); ++i) votes_[i] += weight * other.votes_[i];
  }

 private:
  [[nodiscard]] std::size_t Index(int ref, int curr) const {
    return static_cast<std::size_t>(ref) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(curr);
  }

  int rows_ = 0;
  int columns_ = 0;
  std::vector<double> votes_;
};

// A line of the reference scan and a line of the current scan that are taken for the same wall, as indices
// into the lines of their scans.
struct LinePair {
  int ref = 0;
  int curr = 0;
  double votes = 0.0;
  bool inlier = false;  // The pair agrees with the final result.
};

}  // namespace cairn::slam
