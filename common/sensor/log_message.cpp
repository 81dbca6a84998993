#include "common/sensor/log_message.h"

#include <algorithm>
#include <utility>

#include "common/sensor/lidar_timing.h"
#include "common/sensor/log_fields.h"

namespace cairn {
namespace {

void ReadRanges(LogFields& fields, std::vector<float>& ranges) {
  const int count = fields.Count("number of readings", 1, kMaxReadings);
  // Each reading takes a blank and a digit at least: a short line cannot make us allocate for a long one.
  ranges.reserve(std::min(static_cast<std::size_t>(count), fields.bytes_left() / 2));
  for (int i = 0; i < count && fields.problem().empty(); ++i) ranges.push_back(fields.Range());
}

// The old messages do not say their layout. CARMEN's convention is 180 deg from the right, with one beam more than
// steps where the count is odd (181, 361), and the last beam left out where it is even (180, 360).
void SetHalfTurnLayout(LaserMessage& laser) {
  const auto beams = static_cast<double>(laser.ranges_m.size());
  const bool odd = laser.ranges_m.size() % 2 == 1;
  laser.angle_first_rad = -kPi / 2;
  laser.angle_step_rad = kPi / (odd && beams > 1 ? beams - 1 : beams);
}

void ReadTime(LogFields& fields, Stamp& stamp) {
  stamp = fields.StampSeconds();
  static_cast<void>(fields.Word("host name"));
  fields.SkipReal("logger stamp");
  fields.End();
}

LaserMessage ReadOldLaser(LogFields& fields, LaserKind kind) {
  LaserMessage laser;
  laser.kind = kind;
  ReadRanges(fields, laser.ranges_m);
  SetHalfTurnLayout(laser);
  laser.T_odom_laser = fields.Pose("laser");
  laser.T_odom_robot = fields.Pose("robot");
  ReadTime(fields, laser.stamp);
  return laser;
}

LaserMessage ReadNewLaser(LogFields& fields, LaserKind kind) {
  LaserMessage laser;
  laser.kind = kind;
  if (kind == LaserKind::kTilted) laser.tilt_rad = fields.Real("tilt");
  fields.SkipReal("laser type");
  laser.angle_first_rad = fields.Real("start angle");
  const double field_of_view = fields.Real("field of view");
  laser.angle_step_rad = fields.Real("angular resolution");
  laser.stated_range_max_m = fields.Real("maximum range");
  fields.SkipReal("accuracy");
  fields.SkipReal("remission mode");
  ReadRanges(fields, laser.ranges_m);
  if (laser.angle_step_rad == 0.0 && laser.ranges_m.size() > 1) {
    laser.angle_step_rad = field_of_view / static_cast<double>(laser.ranges_m.size() - 1);
  }
  const int remissions = fields.Count("number of remissions", 0, kMaxReadings);
  for (int i = 0; i < remissions && fields.problem().empty(); ++i) static_cast<void>(fields.Range());
  if (kind != LaserKind::kRaw) {
    laser.T_odom_laser = fields.Pose("laser");
    laser.T_odom_robot = fields.Pose("robot");
    for (const char* what : {"tv", "rv", "forward safety", "side safety", "turn axis"}) fields.SkipReal(what);
  }
  ReadTime(fields, laser.stamp);
  return laser;
}

LaserMessage ReadDpslamLaser(LogFields& fields) {
  LaserMessage laser;
  laser.kind = LaserKind::kDpslam;
  ReadRanges(fields, laser.ranges_m);
  SetHalfTurnLayout(laser);
  fields.End();
  return laser;
}

OdometryMessage ReadOdometry(LogFields& fields) {
  OdometryMessage odometry;
  odometry.T_odom_robot = fields.Pose("robot");
  for (const char* what : {"tv", "rv", "acceleration"}) fields.SkipReal(what);
  ReadTime(fields, odometry.stamp);
  return odometry;
}

OdometryMessage ReadDpslamOdometry(LogFields& fields) {
  OdometryMessage odometry;
  odometry.dpslam = true;
  odometry.T_odom_robot = fields.Pose("robot");
  fields.End();
  return odometry;
}

// What follows the value (CARMEN: time, host, time) is not read.
LogMessage ReadParameter(LogFields& fields) {
  constexpr std::string_view kPrefix = "lidar_";
  std::string name(fields.Word("name"));
  if (!name.starts_with(kPrefix)) return IgnoredMessage{};
  name.erase(0, kPrefix.size());
  std::replace(name.begin(), name.end(), '_', '-');
  if (std::ranges::find(LidarTimingNames(), name) == LidarTimingNames().end()) return IgnoredMessage{};
  const std::string value(fields.Word("value"));
  LidarTiming trial;
  if (const auto set = SetLidarTiming(trial, name, Shown(value)); !set) return BadMessage{true, set.error().message};
  return TimingMessage{std::move(name), value};
}

// SYNC, TRUEPOS, SONAR, GPS_NMEA_GGA, ...
bool LooksLikeMessageName(std::string_view word) {
  constexpr std::size_t kLongest = 40;
  return word.size() >= 2 && word.size() <= kLongest && word[0] >= 'A' && word[0] <= 'Z' &&
         std::all_of(word.begin(), word.end(),
                     [](char c) { return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_'; });
}

// The message, or what is wrong with it. `message` was read from `fields` before this looks at their problem.
template <typename Message>
LogMessage Checked(const LogFields& fields, Message message) {
  if (!fields.problem().empty()) return BadMessage{true, fields.problem()};
  return message;
}

}  // namespace

LogMessage ParseLogLine(std::string_view line) {
  LogFields fields(line);
  const std::string_view kind = fields.Word("message name");
  if (kind.empty() || kind.front() == '#') return NoMessage{};
  if (kind == "FLASER") return Checked(fields, ReadOldLaser(fields, LaserKind::kFront));
  if (kind == "RLASER") return Checked(fields, ReadOldLaser(fields, LaserKind::kRear));
  if (kind == "ROBOTLASER1") return Checked(fields, ReadNewLaser(fields, LaserKind::kRobot));
  if (kind == "RAWLASER1") return Checked(fields, ReadNewLaser(fields, LaserKind::kRaw));
  if (kind == "TILTLASER1") return Checked(fields, ReadNewLaser(fields, LaserKind::kTilted));
  if (kind == "Laser") return Checked(fields, ReadDpslamLaser(fields));
  if (kind == "ODOM") return Checked(fields, ReadOdometry(fields));
  if (kind == "Odometry") return Checked(fields, ReadDpslamOdometry(fields));
  if (kind == "PARAM") return ReadParameter(fields);
  if (LooksLikeMessageName(kind)) return IgnoredMessage{};
  return BadMessage{false, "unknown message '" + Shown(kind) + "'"};
}

}  // namespace cairn
