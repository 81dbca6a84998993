#include "server/slam/filters/genealogy.h"

#include <algorithm>
#include <numeric>

namespace cairn::slam {
namespace {

// Ancestors of more generations ago are forgotten; some tens are left after half as many.
constexpr std::size_t kMaxGenerations = 100;

}  // namespace

void Genealogy::Add(std::span<const int> parents) {
  generations_.emplace_back(particles_);
  std::iota(generations_.back().begin(), generations_.back().end(), 1);
  for (std::vector<int>& ends : generations_) {
    for (int& end : ends)
      end = static_cast<int>(std::lower_bound(parents.begin(), parents.end(), end) - parents.begin());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    if (ends.front() == 0) ends.erase(ends.begin());
  }
  const auto several = std::find_if(generations_.begin(), generations_.end(),
                                    [](const std::vector<int>& ends) { return ends.size() > 1; });
  generations_.erase(generations_.begin(), several);
  if (generations_.size() > kMaxGenerations) generations_.erase(generations_.begin());
}

Eigen::Matrix3d Genealogy::VarianceOfMean(std::span<const double> shares, std::span<const Eigen::Vector3d> deviations,
                                          const Eigen::Vector3d& unit) const {
  std::vector<Eigen::Vector3d> sums(shares.size() + 1, Eigen::Vector3d::Zero());
  Eigen::Matrix3d variance = Eigen::Matrix3d::Zero();  // Were all particles independent.
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const Eigen::Vector3d part = shares[i] * deviations[i];
    sums[i + 1] = sums[i] + part;
    variance += part * part.transpose();
  }
  const auto size = [&](const Eigen::Matrix3d& v) { return v.diagonal().cwiseQuotient(unit.cwiseAbs2()).sum(); };
  double largest = size(variance);
  for (const std::vector<int>& ends : generations_) {
    Eigen::Matrix3d of_families = Eigen::Matrix3d::Zero();
    int begin = 0;
    for (const int end : ends) {
      const Eigen::Vector3d part = sums[static_cast<std::size_t>(end)] - sums[static_cast<std::size_t>(begin)];
      of_families += part * part.transpose();
      begin = end;
    }
    if (const double here = size(of_families); here > largest) {
      largest = here;
      variance = of_families;
    }
  }
  return variance;
}

}  // namespace cairn::slam
