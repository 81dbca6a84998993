// Who descends from whom in a particle set, and from it how far the set's mean may lie from the mean of what the set
// samples: particles of one ancestor err alike, so that a set of few ancestors knows its mean no better than a sample
// of so few would, however narrow it is. Resampling keeps the order of the parents, hence a family is a run of
// neighbours and every generation is a list of where its families end. Frames and units: those of the deviations
// given. Not thread-safe.
// Source: Lee, Whiteley 2018 (variance from the ancestors of one filter; Chan, Lai 2013); Olsson, Douc 2019 (ancestors
// of some generations ago, since all descend from one sooner or later); Mastrototaro, Olsson 2022 (of all lags the one
// that shows the largest variance: short ones miss what was inherited, long ones have run out of ancestors).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace cairn::slam {

class Genealogy {
 public:
  explicit Genealogy(std::size_t particles) : particles_(particles) {}

  // A new generation. `parents`: of every particle, ascending.
  void Add(std::span<const int> parents);
  // Everybody is the same again.
  void Forget() { generations_.clear(); }

  // Covariance of the error of the weighted mean. `shares` sum to 1, `deviations` are from the mean; `unit` makes the
  // components comparable when one lag is chosen: each counts in its square.
  [[nodiscard]] Eigen::Matrix3d VarianceOfMean(std::span<const double> shares,
                                               std::span<const Eigen::Vector3d> deviations,
                                               const Eigen::Vector3d& unit) const;

  // Generations that still have more than one family.
  [[nodiscard]] std::size_t depth() const { return generations_.size(); }

 private:
  std::size_t particles_;
  // Oldest first; of each generation with several families left, one past the last member of every family.
  std::vector<std::vector<int>> generations_;
};

}  // namespace cairn::slam
