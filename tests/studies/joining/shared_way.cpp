#include "tests/studies/joining/shared_way.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace cairn::studies {
namespace {

constexpr double kNearM = 2.0;
constexpr double kEveryM = 0.25;  // Way between two places that are compared.
constexpr double kNever = std::numeric_limits<double>::infinity();

struct Passed {
  Stamp stamp = 0;
  Eigen::Vector2d p;
  double way_m = 0.0;
};

std::vector<Passed> PassedBy(const Trajectory& truth) {
  std::vector<Passed> places;
  double way_m = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Eigen::Vector2d here = truth[i].T_map_robot.translation();
    if (i > 0) way_m += (here - truth[i - 1].T_map_robot.translation()).norm();
    if (places.empty() || way_m >= places.back().way_m + kEveryM) places.push_back({truth[i].stamp, here, way_m});
  }
  return places;
}

struct Range {
  double low_m = kNever, high_m = -kNever;
  void Add(double way_m) {
    low_m = std::min(low_m, way_m);
    high_m = std::max(high_m, way_m);
  }
  [[nodiscard]] double length_m() const { return high_m - low_m; }
};

// The stamp at which two robots have places near each other that lie `apart_m` apart along both ways.
double SharedSince(const std::vector<Passed>& a, const std::vector<Passed>& b, double apart_m) {
  std::vector<std::tuple<Stamp, double, double>> shared;  // When the later of the two came, and where that was.
  for (const Passed& here : a)
    for (const Passed& there : b)
      if ((here.p - there.p).squaredNorm() < kNearM * kNearM)
        shared.emplace_back(std::max(here.stamp, there.stamp), here.way_m, there.way_m);
  std::ranges::sort(shared);
  Range of_a, of_b;
  for (const auto& [stamp, way_a_m, way_b_m] : shared) {
    of_a.Add(way_a_m);
    of_b.Add(way_b_m);
    if (std::min(of_a.length_m(), of_b.length_m()) >= apart_m) return static_cast<double>(stamp);
  }
  return kNever;
}

double WayAt(const std::vector<Passed>& places, double stamp) {
  if (stamp == kNever) return kNever;
  double way_m = 0.0;
  for (const Passed& one : places)
    if (static_cast<double>(one.stamp) <= stamp) way_m = one.way_m;
  return way_m;
}

// The way of each robot until it belongs to the map of the first one.
std::vector<double> WaysUntil(const std::vector<std::vector<Passed>>& robots, double apart_m) {
  std::vector<std::vector<double>> since(robots.size(), std::vector<double>(robots.size(), kNever));
  for (std::size_t b = 1; b < robots.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) since[a][b] = since[b][a] = SharedSince(robots[a], robots[b], apart_m);
  std::vector<double> belongs(robots.size(), kNever);
  belongs[0] = 0.0;
  for (std::size_t round = 1; round < robots.size(); ++round)
    for (std::size_t b = 1; b < robots.size(); ++b)
      for (std::size_t a = 0; a < robots.size(); ++a)
        if (a != b) belongs[b] = std::min(belongs[b], std::max(belongs[a], since[a][b]));
  std::vector<double> ways_m;
  for (std::size_t i = 0; i < robots.size(); ++i) ways_m.push_back(i == 0 ? 0.0 : WayAt(robots[i], belongs[i]));
  return ways_m;
}

}  // namespace

std::vector<SharedWay> SharedWays(const std::vector<Trajectory>& truths) {
  std::vector<std::vector<Passed>> robots;
  for (const Trajectory& truth : truths) robots.push_back(PassedBy(truth));
  const std::vector<double> meets_m = WaysUntil(robots, 0.0), shares_m = WaysUntil(robots, kSharedWayM);
  std::vector<SharedWay> ways;
  for (std::size_t i = 0; i < truths.size(); ++i) ways.push_back({meets_m[i], shares_m[i]});
  return ways;
}

}  // namespace cairn::studies
