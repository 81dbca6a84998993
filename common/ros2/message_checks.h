// What every message of ROS 2 is checked for where its bytes become a value, on the wire and from a bag. Stateless.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/sensor/scan.h"
#include "common/sensor/stamp.h"
#include "common/status.h"

namespace cairn::ros2 {

inline constexpr std::size_t kMaxFrameBytes = 255;
inline constexpr std::size_t kMaxTransforms = 1024;  // In one message.
// Above the limit of ValidateScan, so that a scan with somewhat too many beams still reaches the account of scans.
inline constexpr std::size_t kMaxRanges = 4 * static_cast<std::size_t>(kMaxBeams);

// The name of a frame without a slash in front; it may be empty. Fails for a name that is too long, or that has
// other than printable characters: names are shown to people and compared.
[[nodiscard]] Result<std::string> FrameName(std::string name);
// Fails where the nanoseconds are no part of a second.
[[nodiscard]] Result<Stamp> StampOfTime(std::int32_t seconds, std::uint32_t nanoseconds);

}  // namespace cairn::ros2
