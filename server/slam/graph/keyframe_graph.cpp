#include "server/slam/graph/keyframe_graph.h"

#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace cairn::slam {
namespace {

// Added to every covariance: options may set all noise to zero, but the least squares need positive definite
// covariances.
const Eigen::Matrix3d kLeast = 1e-10 * Eigen::Matrix3d::Identity();

}  // namespace

void KeyframeGraph::Append(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  const std::size_t node = travelled_m_.size();
  loops_.emplace_back();
  if (node == 0) {
    travelled_m_.push_back(0.0);
    return;
  }
  travelled_m_.push_back(travelled_m_.back() + T_prev_curr.translation().norm());
  relations_.push_back({node - 1, node, T_prev_curr, drift_.Covariance(T_prev_curr) + covariance_prev + kLeast, false});
}

void KeyframeGraph::AddLoop(std::size_t from, std::size_t to, const Pose2& T_from_to,
                            const Eigen::Matrix3d& covariance) {
  relations_.push_back({from, to, T_from_to, covariance + kLeast, true});
  const double way_m = T_from_to.translation().norm();
  loops_[from].push_back({to, way_m});
  loops_[to].push_back({from, way_m});
}

std::vector<double> KeyframeGraph::DistancesFromLast() const {
  std::vector<double> distance(size(), std::numeric_limits<double>::infinity());
  if (distance.empty()) return distance;
  using Reached = std::pair<double, std::size_t>;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> open;
  const auto reach = [&](std::size_t node, double way_m) {
    if (way_m >= distance[node]) return;
    distance[node] = way_m;
    open.emplace(way_m, node);
  };
  reach(size() - 1, 0.0);
  while (!open.empty()) {
    const auto [way_m, node] = open.top();
    open.pop();
    if (way_m > distance[node]) continue;
    if (node > 0) reach(node - 1, way_m + travelled_m_[node] - travelled_m_[node - 1]);
    if (node + 1 < size()) reach(node + 1, way_m + travelled_m_[node + 1] - travelled_m_[node]);
    for (const Loop& loop : loops_[node]) reach(loop.other, way_m + loop.way_m);
  }
  return distance;
}

}  // namespace cairn::slam
