#include "common/sensor/carmen_writer.h"

#include <cmath>
#include <string>

#include "common/options/number_text.h"
#include "common/sensor/stamp.h"

namespace cairn {
namespace {

template <typename Real>
void Append(std::string& line, Real value) {
  line += ' ' + ExactText(value);
}

void Append(std::string& line, const Pose2& pose) {
  Append(line, pose.x);
  Append(line, pose.y);
  Append(line, pose.theta);
}

// CARMEN's lasers answer numbers: what hit nothing gets the range limit, what says nothing gets 0.
void AppendRanges(std::string& line, const Scan& scan) {
  line += ' ' + std::to_string(scan.ranges_m.size());
  for (const float range : scan.ranges_m) {
    switch (ClassifyRange(range, scan.range_min_m, scan.range_max_m)) {
      case BeamClass::kHit:
        Append(line, range);
        break;
      case BeamClass::kNoReturn: {
        // Rounded up: a float just below the limit would read back as a hit.
        auto limit = static_cast<float>(scan.range_max_m);
        if (static_cast<double>(limit) < scan.range_max_m) limit = std::nextafter(limit, INFINITY);
        Append(line, limit);
        break;
      }
      case BeamClass::kInvalid:
        line += " 0";
        break;
    }
  }
}

// Whether a FLASER line says everything: the layout and the range limit the reader supposes for it.
bool IsFlaserLayout(const Scan& scan) {
  constexpr double kSickLimit = 80.0;
  const auto beams = static_cast<double>(scan.ranges_m.size());
  const double step = kPi / (scan.ranges_m.size() % 2 == 1 ? beams - 1 : beams);
  return scan.ranges_m.size() > 1 && scan.range_max_m == kSickLimit &&
         std::abs(scan.angle_first_rad + kPi / 2) < 1e-9 && std::abs(scan.angle_step_rad - step) < 1e-9;
}

}  // namespace

CarmenWriter::CarmenWriter(std::ostream& out) : out_(out) {}

void CarmenWriter::Write(const Odometry& odometry) {
  std::string line = "ODOM";
  Append(line, odometry.T_odom_robot);
  line += " 0 0 0";
  WriteTime(line, odometry.stamp);
}

void CarmenWriter::Write(const Scan& scan, const Pose2& T_odom_robot) {
  WriteTiming(scan);
  const bool tilted = scan.tilt_rad != 0.0;
  const bool flaser = !tilted && IsFlaserLayout(scan);
  std::string line = flaser ? "FLASER" : tilted ? "TILTLASER1" : "ROBOTLASER1 0";
  if (tilted) {
    Append(line, scan.tilt_rad);
    line += " 0";  // Laser type.
  }
  if (!flaser) {
    Append(line, scan.angle_first_rad);
    Append(line, scan.angle_step_rad * (static_cast<double>(scan.ranges_m.size()) - 1.0));
    Append(line, scan.angle_step_rad);
    Append(line, scan.range_max_m);
    line += " 0.01 0";  // Accuracy (m) and remission mode (none).
  }
  AppendRanges(line, scan);
  if (!flaser) line += " 0";  // Remissions.
  Append(line, T_odom_robot * scan.T_robot_laser);
  Append(line, T_odom_robot);
  if (!flaser) line += " 0 0 0 0 0";  // tv rv forward_safety side_safety turn_axis
  WriteTime(line, scan.stamp);
}

void CarmenWriter::WriteTiming(const Scan& scan) {
  const double period_s = scan.beam_period_s / std::abs(scan.angle_step_rad) * 2.0 * kPi;
  if (period_s == scan_period_s_) return;
  scan_period_s_ = period_s;
  out_ << "PARAM lidar_scan_period " << ExactText(period_s) << '\n';
}

void CarmenWriter::WriteTime(std::string& line, Stamp stamp) {
  if (!has_first_) first_stamp_ = stamp;
  has_first_ = true;
  line += ' ' + FormatStamp(stamp) + " cairn";
  Append(line, SecondsFromStamp(stamp - first_stamp_));
  line += '\n';
  out_ << line;
}

}  // namespace cairn
