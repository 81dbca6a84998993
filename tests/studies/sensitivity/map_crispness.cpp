#include "tests/studies/sensitivity/map_crispness.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "server/slam/scan/beam_points.h"

namespace cairn::studies {
namespace {

constexpr double kRadiusM = 0.3;
// Points this near count as one, so that a standing robot's scans count once.
constexpr double kSameM = 0.005;
constexpr Stamp kSameStamp = kNanosPerSecond / 20;
constexpr std::size_t kMaxScans = 1500;   // Evenly spread over longer logs.
constexpr std::size_t kMaxPlaces = 4000;  // Number of places at which the surrounding points are examined.
constexpr std::size_t kMinNeighbours = 10;

std::int64_t CellKey(const Eigen::Vector2d& p, double side_m) {
  const auto x = static_cast<std::int64_t>(std::floor(p.x() / side_m));
  const auto y = static_cast<std::int64_t>(std::floor(p.y() / side_m));
  return (x << 32) ^ (y & 0xffffffff);
}

std::optional<Pose2> PoseAt(const Trajectory& trajectory, Stamp stamp) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), stamp - kSameStamp,
                                      [](const StampedPose& pose, Stamp at) { return pose.stamp < at; });
  std::optional<Pose2> nearest;
  Stamp best = kSameStamp + 1;
  for (auto at = after; at != trajectory.end() && at->stamp <= stamp + kSameStamp; ++at) {
    const Stamp apart = std::abs(at->stamp - stamp);
    if (apart >= best) continue;
    best = apart;
    nearest = at->T_map_robot;
  }
  return nearest;
}

std::vector<Eigen::Vector2d> CloudOf(const StudyLog& log, const Trajectory& trajectory) {
  std::vector<Eigen::Vector2d> cloud;
  std::unordered_set<std::int64_t> taken;
  const std::size_t every = log.scans() / kMaxScans + 1;
  std::size_t index = 0;
  for (const LogRecord& record : log.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr || index++ % every != 0) continue;
    const auto T_map_robot = PoseAt(trajectory, scan->stamp);
    if (!T_map_robot) continue;
    for (const slam::BeamPoint& point : slam::PointsOf(*scan)) {
      const Eigen::Vector2d p = *T_map_robot * point.p_robot;
      if (taken.insert(CellKey(p, kSameM)).second) cloud.push_back(p);
    }
  }
  return cloud;
}

}  // namespace

MapCrispness CrispnessOf(const StudyLog& log, const Trajectory& trajectory) {
  const std::vector<Eigen::Vector2d> cloud = CloudOf(log, trajectory);
  std::unordered_map<std::int64_t, std::vector<Eigen::Vector2d>> cells;
  for (const Eigen::Vector2d& p : cloud) cells[CellKey(p, kRadiusM)].push_back(p);
  double log_areas = 0.0;
  std::vector<double> thicknesses;
  for (std::size_t i = 0; i < cloud.size(); i += cloud.size() / kMaxPlaces + 1) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
    std::size_t count = 0;
    for (int step = 0; step < 9; ++step) {
      const Eigen::Vector2d in_cell = cloud[i] + kRadiusM * Eigen::Vector2d(step % 3 - 1, step / 3 - 1);
      const auto cell = cells.find(CellKey(in_cell, kRadiusM));
      if (cell == cells.end()) continue;
      for (const Eigen::Vector2d& p : cell->second) {
        const Eigen::Vector2d d = p - cloud[i];
        if (d.squaredNorm() > kRadiusM * kRadiusM) continue;
        sum += d;
        squares += d * d.transpose();
        ++count;
      }
    }
    if (count < kMinNeighbours) continue;
    const auto n = static_cast<double>(count);
    const Eigen::Matrix2d S = (squares - sum * sum.transpose() / n) / (n - 1.0) + 1e-8 * Eigen::Matrix2d::Identity();
    log_areas += 0.5 * std::log(S.determinant());
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
    solver.computeDirect(S);
    thicknesses.push_back(std::sqrt(std::max(0.0, solver.eigenvalues()(0))));
  }
  if (thicknesses.empty()) return {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  const auto middle = thicknesses.begin() + static_cast<std::ptrdiff_t>(thicknesses.size() / 2);
  std::nth_element(thicknesses.begin(), middle, thicknesses.end());
  return {std::exp(0.5 * log_areas / static_cast<double>(thicknesses.size())), *middle};
}

}  // namespace cairn::studies
