#include "common/sensor/lidar_timing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/options/number_text.h"

namespace cairn {
namespace {

constexpr double kLongestPeriod_s = 10.0;
constexpr double kTurn = 2.0 * kPi;
// The two ends of an array are joined only if the beams lie on a grid of the full turn, up to this share of a step.
constexpr double kOffGrid = 0.1;

tl::unexpected<Status> BadValue(std::string_view name, std::string_view text, const char* wanted) {
  return Fail(StatusCode::kInvalidArgument, std::string(name) + ": '" + std::string(text) + "' is not " + wanted);
}

bool HasGrid(const Scan& scan) {
  return !scan.ranges_m.empty() && std::isfinite(scan.angle_first_rad) && std::isfinite(scan.angle_step_rad) &&
         std::abs(scan.angle_step_rad) >= kTurn / (4.0 * kMaxBeams) && std::abs(scan.angle_first_rad) <= 2.0 * kTurn;
}

void Reverse(Scan& scan) {
  scan.angle_first_rad += scan.angle_step_rad * (static_cast<double>(scan.ranges_m.size()) - 1.0);
  scan.angle_step_rad = -scan.angle_step_rad;
  std::reverse(scan.ranges_m.begin(), scan.ranges_m.end());
}

// The first beam that the lidar measures after it has passed `from`; 0 also if none lies behind it. A beam at `from`
// is measured after it, although it may lie a rounding error before.
std::size_t FirstAfter(double from_rad, const Scan& scan) {
  const double step = std::abs(scan.angle_step_rad);
  double passed = std::fmod((scan.angle_first_rad - from_rad) * (scan.angle_step_rad > 0.0 ? 1.0 : -1.0), kTurn);
  if (passed < 0.0) passed += kTurn;
  if (kTurn - passed < 0.5 * step) return 0;
  const auto first = static_cast<std::size_t>(std::ceil((kTurn - passed) / step - 0.5));
  return first < scan.ranges_m.size() ? first : 0;
}

Result<void> BeginAt(double from_rad, Scan& scan) {
  const std::size_t first = FirstAfter(from_rad, scan);
  if (first == 0) return {};
  const double step = std::abs(scan.angle_step_rad);
  const double turn = std::round(kTurn / step);
  if (std::abs(turn * step - kTurn) > kOffGrid * step || turn > kMaxBeams)
    return Fail(StatusCode::kInvalidArgument, "the turn begins within the scan, whose beams are on no grid of a turn");
  // Where the last beam has the first one's direction again, it is left out.
  scan.ranges_m.resize(static_cast<std::size_t>(turn), std::numeric_limits<float>::quiet_NaN());
  std::rotate(scan.ranges_m.begin(), scan.ranges_m.begin() + static_cast<std::ptrdiff_t>(first), scan.ranges_m.end());
  scan.angle_first_rad = WrapAngle(scan.angle_first_rad + static_cast<double>(first) * scan.angle_step_rad);
  return {};
}

}  // namespace

std::span<const std::string_view> LidarTimingNames() {
  static constexpr std::array<std::string_view, 4> kNames = {"scan-period", "stamp-at", "clockwise", "turn-from"};
  return kNames;
}

Result<void> SetLidarTiming(LidarTiming& timing, std::string_view name, std::string_view text) {
  double number = 0.0;
  if (name == "scan-period") {
    if (!ParseNumber(text, number) || !(number >= 0.0 && number <= kLongestPeriod_s))
      return BadValue(name, text, "a time from 0 to 10 s");
    timing.scan_period_s = number;
  } else if (name == "stamp-at") {
    if (text != "first" && text != "middle" && text != "last") return BadValue(name, text, "first, middle or last");
    timing.stamp_at = text == "first" ? StampAt::kFirst : text == "middle" ? StampAt::kMiddle : StampAt::kLast;
  } else if (name == "clockwise") {
    if (text != "on" && text != "off") return BadValue(name, text, "on or off");
    timing.clockwise = text == "on";
  } else if (name == "turn-from") {
    if (!ParseNumber(text, number) || !(std::abs(number) <= 360.0))
      return BadValue(name, text, "an angle from -360 to 360 deg");
    timing.turn_from_rad = Radians(number);
  } else {
    return Fail(StatusCode::kNotFound, "a lidar's timing has no '" + std::string(name) + "'");
  }
  return {};
}

LidarTiming Merge(const LidarTiming& over, const LidarTiming& under) {
  LidarTiming both = over;
  if (!both.scan_period_s) both.scan_period_s = under.scan_period_s;
  if (!both.stamp_at) both.stamp_at = under.stamp_at;
  if (!both.clockwise) both.clockwise = under.clockwise;
  if (!both.turn_from_rad) both.turn_from_rad = under.turn_from_rad;
  return both;
}

Result<void> PutInOrderOfTime(const LidarTiming& timing, Scan& scan) {
  if (!HasGrid(scan)) return {};
  // Of the scan itself, where something else is said of its times.
  const bool said = timing.stamp_at || timing.clockwise || timing.turn_from_rad;
  const double own_period_s = said ? std::abs(scan.beam_period_s) * kTurn / std::abs(scan.angle_step_rad) : 0.0;
  const double period_s = timing.scan_period_s.value_or(own_period_s);
  if (period_s <= 0.0) return {};
  Scan timed = scan;
  if (timing.clockwise.value_or(timed.angle_step_rad < 0.0) != (timed.angle_step_rad < 0.0)) Reverse(timed);
  if (timing.turn_from_rad)
    if (auto begun = BeginAt(*timing.turn_from_rad, timed); !begun) return begun;
  timed.beam_period_s = period_s * std::abs(timed.angle_step_rad) / kTurn;
  const double duration_s = timed.beam_period_s * (static_cast<double>(timed.ranges_m.size()) - 1.0);
  constexpr std::array<double, 3> kShares = {0.0, 0.5, 1.0};
  const double since_first_s =
      duration_s * kShares[static_cast<std::size_t>(timing.stamp_at.value_or(StampAt::kFirst))];
  // Unsigned, because the stamp of a log may be anywhere in int64.
  timed.stamp = static_cast<Stamp>(static_cast<std::uint64_t>(timed.stamp) -
                                   static_cast<std::uint64_t>(std::llround(since_first_s * 1e9)));
  scan = std::move(timed);
  return {};
}

}  // namespace cairn
