// One line of a robot log as it stands, before any knowledge of the whole file is applied (range limit, mounting,
// time).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"

namespace cairn {

// FLASER, RLASER, ROBOTLASER1, RAWLASER1, Laser, TILTLASER1.
enum class LaserKind { kFront = 0, kRear, kRobot, kRaw, kDpslam, kTilted };
inline constexpr int kLaserKindCount = 6;

struct LaserMessage {
  LaserKind kind = LaserKind::kFront;
  Stamp stamp = 0;  // DP-SLAM: 0, it has none.
  double angle_first_rad = 0.0;
  double angle_step_rad = 0.0;
  double tilt_rad = 0.0;            // TILTLASER1 only.
  double stated_range_max_m = 0.0;  // 0: the message does not say.
  std::vector<float> ranges_m;
  std::optional<Pose2> T_odom_laser;
  std::optional<Pose2> T_odom_robot;
};

struct OdometryMessage {
  Stamp stamp = 0;
  bool dpslam = false;
  Pose2 T_odom_robot;
};

// PARAM lidar_NAME VALUE: one of LidarTimingNames, with '_' for '-'.
struct TimingMessage {
  std::string name;
  std::string value;
};

struct NoMessage {};       // Blank line or comment.
struct IgnoredMessage {};  // A message of another kind.
struct BadMessage {
  bool known_kind = false;  // It began like a message this reader knows.
  std::string reason;
};

using LogMessage = std::variant<NoMessage, IgnoredMessage, BadMessage, LaserMessage, OdometryMessage, TimingMessage>;

// More readings than any scanner has are refused before anything is allocated for them.
inline constexpr int kMaxReadings = 100'000;

[[nodiscard]] LogMessage ParseLogLine(std::string_view line);

}  // namespace cairn
