// When the beams of a turning lidar were measured. Logs and drivers seldom say it: they give one stamp for a whole
// scan, and drivers often turn the array over or begin it at another angle than the lidar. What a person, or the log
// itself, says about the lidar is kept here, and turns a scan as it was logged into one whose array is in the order of
// time, with the stamp of its first beam and the time between two beams (scan.h). Plain values; stateless functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/sensor/scan.h"
#include "common/status.h"

namespace cairn {

// Which beam of a scan its stamp belongs to.
enum class StampAt : std::uint8_t { kFirst, kMiddle, kLast };

// Values that are not set are unknown. Without scan_period_s the others count for scans that say themselves how long a
// turn takes (Scan::beam_period_s), as those of bags; other scans stay as they are.
struct LidarTiming {
  std::optional<double> scan_period_s;  // Of a full turn, whatever part of it is measured. 0: all beams at once.
  std::optional<StampAt> stamp_at;      // Not set: kFirst.
  std::optional<bool> clockwise;        // Seen from above the robot. Not set: the lidar turned in the array's order.
  std::optional<double> turn_from_rad;  // Where the lidar begins its turn. Not set: at one end of the array.
};

// The four values by their names, for a command line and for logs: scan-period (s), stamp-at (first, middle, last),
// clockwise (on, off), turn-from (deg).
[[nodiscard]] std::span<const std::string_view> LidarTimingNames();
[[nodiscard]] Result<void> SetLidarTiming(LidarTiming& timing, std::string_view name, std::string_view text);

// What is set in `over`, else what is set in `under`.
[[nodiscard]] LidarTiming Merge(const LidarTiming& over, const LidarTiming& under);

// Puts the array into the order of time, sets the beam period, and moves the stamp to the first beam. A lidar that
// begins its turn within the array has measured the array's end first: the array is cut there and joined at its ends,
// with invalid beams where it is less than a full turn. Fails, and changes nothing, where the beams do not fit
// on a full turn or are more than kMaxBeams then. A scan that ValidateScan refuses for its angles stays as it is.
[[nodiscard]] Result<void> PutInOrderOfTime(const LidarTiming& timing, Scan& scan);

}  // namespace cairn
