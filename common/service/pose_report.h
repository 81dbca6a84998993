// The server's current estimate of where a robot is.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"
#include "common/service/generation.h"
#include "common/service/names.h"

namespace cairn {

enum class PoseReason : std::uint8_t {
  kTracking = 0,  // Scans match.
  kOdometryOnly,  // The last scans did not match; pose by odometry.
  kDegenerate,    // One direction is not seen (corridor): odometry along it.
  kLost,          // Too far by odometry alone, or the estimate contradicts the scans.
  kDiverged,      // The filter's belief contradicts what is seen, or failed numerically.
  kWaiting,       // No scan used yet.
  // Nobody has said where the robot started, and what it has seen is not joined with the map of the site yet: its pose
  // is relative to its start, and its part of the map is not shown.
  kNotJoined,
};
[[nodiscard]] std::string_view PoseReasonName(PoseReason reason);

struct PoseReport {
  NameId robot_id = 0;
  std::string robot;
  std::string site;
  Stamp stamp = 0;
  std::uint64_t session = 0;        // The session (SessionToken) of the scan this pose belongs to.
  std::uint64_t scan_sequence = 0;  // The scan this pose belongs to; 0 for an interpolated answer.
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // For (x, y, theta) in the frame map.
  Pose2 T_map_odom;
  bool localized = false;
  double score = 0.0;  // 0..1: share of the scan explained by the map.
  PoseReason reason = PoseReason::kWaiting;
  std::uint32_t map_epoch = 0;
  Generation generation = 0;  // Set by the server's egress.
};

// A place where a robot may be, as the particles of its filter say.
struct PoseHypothesis {
  Stamp stamp = 0;
  Pose2 T_map_robot;
  double weight = 0.0;  // Its share of the belief, 0..1.
};
inline constexpr std::size_t kMostHypotheses = 8;

}  // namespace cairn
