#include "tests/studies/relations.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>

namespace cairn::studies {
namespace {

constexpr Stamp kMaxGap = 2 * kNanosPerSecond;
constexpr Stamp kSameStamp = 100'000;  // 0.1 ms: logs round their stamps.

std::optional<Pose2> PoseAt(const Trajectory& trajectory, Stamp stamp) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), stamp,
                                      [](const StampedPose& pose, Stamp at) { return pose.stamp < at; });
  if (after != trajectory.begin() && stamp - std::prev(after)->stamp < kSameStamp) return std::prev(after)->T_map_robot;
  if (after == trajectory.end()) return std::nullopt;
  if (after->stamp - stamp < kSameStamp) return after->T_map_robot;
  if (after == trajectory.begin()) return std::nullopt;
  const StampedPose& before = *std::prev(after);
  if (after->stamp - before.stamp > kMaxGap) return std::nullopt;
  const double share = static_cast<double>(stamp - before.stamp) / static_cast<double>(after->stamp - before.stamp);
  return Interpolate(before.T_map_robot, after->T_map_robot, share);
}

struct Moments {
  double mean, deviation, max;
};

Moments MomentsOf(const std::vector<double>& values) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (values.empty()) return {kNone, kNone, kNone};
  double sum = 0.0, squares = 0.0;
  for (const double value : values) sum += value;
  const double mean = sum / static_cast<double>(values.size());
  for (const double value : values) squares += (value - mean) * (value - mean);
  return {mean, std::sqrt(squares / static_cast<double>(values.size())),
          *std::max_element(values.begin(), values.end())};
}

}  // namespace

Result<std::vector<Relation>> ReadRelations(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) return Fail(StatusCode::kUnavailable, "cannot open " + path.string());
  std::vector<Relation> relations;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    std::istringstream fields(line);
    double from = 0, to = 0, x = 0, y = 0, z = 0, roll = 0, pitch = 0, yaw = 0;
    if (!(fields >> from >> to >> x >> y >> z >> roll >> pitch >> yaw))
      return Fail(StatusCode::kInvalidArgument, path.string() + ":" + std::to_string(number) + ": expected 8 numbers");
    relations.push_back({StampFromSeconds(from), StampFromSeconds(to), {x, y, WrapAngle(yaw)}});
  }
  return relations;
}

std::vector<RelationResidual> ResidualsOf(const Trajectory& trajectory, const std::vector<Relation>& relations) {
  std::vector<RelationResidual> residuals;
  for (const Relation& relation : relations) {
    const auto T_map_from = PoseAt(trajectory, relation.from), T_map_to = PoseAt(trajectory, relation.to);
    if (!T_map_from || !T_map_to) continue;
    const Pose2 off = Between(relation.T_from_to, Between(*T_map_from, *T_map_to));
    residuals.push_back({relation.from, relation.to, off.translation().norm(), Degrees(std::abs(off.theta))});
  }
  return residuals;
}

RelationError ErrorOf(const Trajectory& trajectory, const std::vector<Relation>& relations) {
  RelationError error;
  std::vector<double> distances, angles;
  for (const RelationResidual& residual : ResidualsOf(trajectory, relations)) {
    distances.push_back(residual.trans_m);
    angles.push_back(residual.rot_deg);
  }
  error.compared = distances.size();
  error.missing = relations.size() - error.compared;
  const Moments trans = MomentsOf(distances), rot = MomentsOf(angles);
  error.trans_mean_m = trans.mean, error.trans_deviation_m = trans.deviation, error.trans_max_m = trans.max;
  error.rot_mean_deg = rot.mean, error.rot_deviation_deg = rot.deviation, error.rot_max_deg = rot.max;
  return error;
}

}  // namespace cairn::studies
