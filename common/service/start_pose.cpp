#include "common/service/start_pose.h"

#include <array>
#include <cmath>

#include "common/options/number_text.h"

namespace cairn {

namespace {

constexpr double kMostRadians = 1e6;  // A wrapped angle beyond has few digits left.

}  // namespace

Result<void> ValidateStart(const Pose2& T_map_robot_start) {
  constexpr double kFarthest_m = 1e6;
  const Pose2& start = T_map_robot_start;
  if (!start.IsFinite() || std::abs(start.x) > kFarthest_m || std::abs(start.y) > kFarthest_m) {
    return Fail(StatusCode::kInvalidArgument, "the start pose is not finite or more than 1000 km away");
  }
  if (std::abs(start.theta) > kMostRadians)
    return Fail(StatusCode::kInvalidArgument, "the heading of the start pose is more than a million radians");
  return {};
}

Result<Pose2> ParseStart(const std::string& text) {
  const auto parts = SplitAtCommas(text);
  std::array<double, 3> values{};
  bool good = parts.size() == values.size();
  for (std::size_t i = 0; good && i < values.size(); ++i) {
    const auto number = SplitNumber(parts[i]);
    const bool degrees = i == 2 && number && number->second == "deg";
    good = number && (number->second.empty() || degrees);
    if (good) values[i] = degrees ? Radians(number->first) : number->first;
  }
  if (!good || std::abs(values[2]) > kMostRadians) {
    return Fail(StatusCode::kInvalidArgument,
                "'" + text + "' is not a pose such as 1.5,-2,0.79 (metres, radians) or 1.5,-2,45deg");
  }
  const Pose2 start{values[0], values[1], WrapAngle(values[2])};
  if (const auto valid = ValidateStart(start); !valid)
    return Fail(StatusCode::kInvalidArgument, "'" + text + "': " + valid.error().message);
  return start;
}

}  // namespace cairn
