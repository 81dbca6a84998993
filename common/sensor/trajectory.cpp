#include "common/sensor/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "common/file/atomic_file.h"
#include "common/sensor/log_fields.h"
#include "common/sensor/stamp.h"

namespace cairn {
namespace {

tl::unexpected<Status> BadLine(const std::filesystem::path& path, int line, const std::string& reason) {
  return Fail(StatusCode::kInvalidArgument, path.string() + ":" + std::to_string(line) + ": " + reason);
}

std::string TumLine(const StampedPose& pose) {
  const double half = pose.T_map_robot.theta / 2;
  std::array<char, 256> text{};
  std::snprintf(text.data(), text.size(), " %.9f %.9f 0 0 0 %.12f %.12f\n", pose.T_map_robot.x, pose.T_map_robot.y,
                std::sin(half), std::cos(half));
  return FormatStamp(pose.stamp) + text.data();
}

// The heading of a rotation given as a quaternion (roll and pitch are left out).
double Yaw(double qx, double qy, double qz, double qw) {
  return std::atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz));
}

}  // namespace

std::optional<Pose2> PoseOn(const Trajectory& path, Stamp stamp, double max_gap_s) {
  const auto after = std::lower_bound(path.begin(), path.end(), stamp,
                                      [](const StampedPose& pose, Stamp s) { return pose.stamp < s; });
  if (after == path.end()) return std::nullopt;
  if (after->stamp == stamp) return after->T_map_robot;
  if (after == path.begin()) return std::nullopt;
  const auto before = std::prev(after);
  // Without overflow, for stamps a broken clock may place anywhere in int64.
  const auto nanos = [&](Stamp later) {
    return static_cast<double>(static_cast<std::uint64_t>(later) - static_cast<std::uint64_t>(before->stamp));
  };
  if (nanos(after->stamp) * 1e-9 > max_gap_s) return std::nullopt;
  return Interpolate(before->T_map_robot, after->T_map_robot, nanos(stamp) / nanos(after->stamp));
}

Result<void> WriteTum(const Trajectory& trajectory, const std::filesystem::path& path) {
  std::string text;
  text.reserve(trajectory.size() * 96);
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const StampedPose& pose = trajectory[i];
    constexpr double kFarthest = 1e9;  // m; keeps the line in its buffer.
    if (!pose.T_map_robot.IsFinite() || pose.T_map_robot.translation().cwiseAbs().maxCoeff() > kFarthest) {
      return Fail(StatusCode::kInvalidArgument, "pose " + std::to_string(i) + " is not finite");
    }
    if (i > 0 && pose.stamp <= trajectory[i - 1].stamp) {
      return Fail(StatusCode::kInvalidArgument,
                  "pose " + std::to_string(i) + ": stamp " + FormatStamp(pose.stamp) + " is not after the one before");
    }
    text += TumLine(pose);
  }
  return WriteFileAtomically(path, text);
}

Result<Trajectory> ReadTum(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return Fail(StatusCode::kNotFound, path.string() + ": no such file");
  LogLines lines(path);
  if (!lines.is_open()) return Fail(StatusCode::kPermissionDenied, path.string() + ": cannot be opened");
  Trajectory trajectory;
  std::string_view line;
  while (lines.Next(line)) {
    if (lines.too_long()) return BadLine(path, lines.number(), "line too long");
    const std::size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos || line[begin] == '#') continue;
    LogFields fields(line);
    StampedPose pose;
    pose.stamp = fields.StampSeconds();
    pose.T_map_robot.x = fields.Real("tx");
    pose.T_map_robot.y = fields.Real("ty");
    fields.SkipReal("tz");
    const double qx = fields.Real("qx"), qy = fields.Real("qy"), qz = fields.Real("qz"), qw = fields.Real("qw");
    fields.End();
    if (!fields.problem().empty()) return BadLine(path, lines.number(), fields.problem());
    constexpr double kNormSlack = 1e-3;  // Files with few decimals are still rotations.
    if (std::abs(std::hypot(std::hypot(qx, qy), std::hypot(qz, qw)) - 1.0) > kNormSlack) {
      return BadLine(path, lines.number(), "quaternion is not of unit length");
    }
    pose.T_map_robot.theta = WrapAngle(Yaw(qx, qy, qz, qw));
    if (!trajectory.empty() && pose.stamp <= trajectory.back().stamp) {
      return BadLine(path, lines.number(), "stamp is not after the one before");
    }
    trajectory.push_back(pose);
  }
  if (lines.failed()) return Fail(StatusCode::kDataLoss, path.string() + ": reading failed");
  return trajectory;
}

}  // namespace cairn
