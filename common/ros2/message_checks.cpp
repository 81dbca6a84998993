#include "common/ros2/message_checks.h"

#include <algorithm>
#include <utility>

namespace cairn::ros2 {

Result<std::string> FrameName(std::string name) {
  if (name.size() > kMaxFrameBytes) return Fail(StatusCode::kOutOfRange, "a name of a frame is too long");
  const bool printable = std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c <= '~'; });
  if (!printable) return Fail(StatusCode::kOutOfRange, "a name of a frame has other than printable characters");
  if (!name.empty() && name.front() == '/') name.erase(0, 1);
  return name;
}

Result<Stamp> StampOfTime(std::int32_t seconds, std::uint32_t nanoseconds) {
  if (nanoseconds >= static_cast<std::uint32_t>(kNanosPerSecond))
    return Fail(StatusCode::kOutOfRange, "a stamp has a second or more of nanoseconds");
  return static_cast<Stamp>(seconds) * kNanosPerSecond + nanoseconds;
}

}  // namespace cairn::ros2
