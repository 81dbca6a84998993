#include "server/slam/site/consistent_set.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

using Agreeing = std::vector<std::vector<char>>;

std::vector<std::size_t> GrownFrom(std::size_t start, const Agreeing& agree) {
  const std::size_t count = agree.size();
  std::vector<std::size_t> set{start};
  std::vector<std::size_t> left;  // Those that agree with all of the set.
  for (std::size_t i = 0; i < count; ++i)
    if (i != start && agree[start][i] != 0) left.push_back(i);
  while (!left.empty()) {
    std::size_t best = left.front();
    std::size_t most = 0;
    for (const std::size_t i : left) {
      const auto others =
          static_cast<std::size_t>(std::ranges::count_if(left, [&](std::size_t j) { return agree[i][j] != 0; }));
      if (others <= most) continue;
      most = others;
      best = i;
      if (others + 1 == left.size()) break;  // It agrees with all.
    }
    set.push_back(best);
    std::erase_if(left, [&](std::size_t i) { return i == best || agree[best][i] == 0; });
  }
  std::ranges::sort(set);
  return set;
}

}  // namespace

std::vector<std::size_t> LargestConsistentSet(std::size_t count,
                                              const std::function<bool(std::size_t, std::size_t)>& agree) {
  Agreeing table(count, std::vector<char>(count, 0));
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = i + 1; j < count; ++j) table[i][j] = table[j][i] = agree(i, j) ? 1 : 0;
  std::vector<std::size_t> largest;
  for (std::size_t start = 0; start < count; ++start) {
    auto set = GrownFrom(start, table);
    if (set.size() > largest.size()) largest = std::move(set);
  }
  return largest;
}

double Disagreement2(const SessionRelation& a, const SessionRelation& b, const SessionMap& from, const SessionMap& to,
                     const LoopOptions& loop) {
  const auto& path_from = from.own_path();
  const auto& path_to = to.own_path();
  const Pose2 T_a_b = Between(path_from[a.from.keyframe], path_from[b.from.keyframe]);
  const Pose2 other_way = a.T_from_to * Between(path_to[a.to.keyframe], path_to[b.to.keyframe]) * b.T_from_to.Inverse();
  const Eigen::Vector3d error = Minus(other_way, T_a_b);
  const double way_m = std::abs(from.travelled_m(a.from.keyframe) - from.travelled_m(b.from.keyframe)) +
                       std::abs(to.travelled_m(a.to.keyframe) - to.travelled_m(b.to.keyframe));
  // An error of heading at one relation moves the other by the distance between them.
  const double apart_m = T_a_b.translation().norm();
  const double turn_variance = a.covariance(2, 2) + b.covariance(2, 2) + std::pow(loop.doubt_rad_per_m * way_m, 2);
  Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
  S.topLeftCorner<2, 2>() =
      a.covariance.topLeftCorner<2, 2>() + b.covariance.topLeftCorner<2, 2>() +
      (std::pow(loop.doubt_per_m * way_m, 2) + turn_variance * apart_m * apart_m) * Eigen::Matrix2d::Identity();
  S(2, 2) = turn_variance;
  return error.dot(S.ldlt().solve(error));
}

}  // namespace cairn::slam
