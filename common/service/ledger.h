// Counts what happened to every sample (scan or odometry) of one stream (robot, sensor): received +
// dropped[kLostOnWire] = used
// + sum(dropped) + waiting. No sample is uncounted.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/sensor/scan.h"
#include "common/sensor/stamp.h"
#include "common/service/generation.h"
#include "common/service/names.h"

namespace cairn {

enum class DropReason : std::uint8_t {
  kNoOdometry = 0,  // No odometry near the scan's stamp, before or after.
  kDuplicateStamp,  // Same stamp as the scan before.
  kStampWentBack,   // Older than the scan before.
  kStampJump,       // Too far ahead of the scan before; a clock that stays there is accepted after a few scans.
  kBadGeometry,     // These three: ScanFault.
  kTooManyBeams,
  kEmpty,
  kNoSession,   // The robot has not opened a session, or was refused one.
  kNotOwner,    // Another client owns the robot's session.
  kQueueFull,   // Back-pressure: the oldest waiting scan gives way.
  kLostOnWire,  // Sequence numbers that never arrived.
  kSessionEnded,
  kSessionFull,  // The session has as many keyframes, or as large a map, as the server allows.
};
inline constexpr int kDropReasonCount = 13;

// snake_case, as metrics and JSON show it.
[[nodiscard]] std::string_view DropReasonName(DropReason reason);
// The account that a refused scan goes to.
[[nodiscard]] DropReason DropReasonOf(ScanFault fault);

struct Ledger {
  NameId robot_id = 0;
  NameId sensor_id = 0;
  std::string robot;
  std::string sensor;
  std::string site;
  std::uint64_t received = 0;
  std::uint64_t used = 0;       // Localised; part of them also updated the map.
  std::uint64_t keyframes = 0;  // Those of `used` that updated filter and map.
  std::uint64_t waiting = 0;    // In the queue.
  std::array<std::uint64_t, kDropReasonCount> dropped{};
  std::uint64_t odometry_received = 0;
  std::uint64_t odometry_dropped = 0;  // Refused by validation or stamp order.
  std::uint64_t odometry_merged = 0;   // Composed into a neighbour by the full queue; motion is kept.
  std::uint64_t last_sequence = 0;     // Highest sequence received.
  std::uint64_t settled_through = 0;   // Every sample up to here is used or dropped.
  std::uint64_t durable_through = 0;   // Every sample up to here is on the disk; 0 without a store.
  Stamp last_stamp = 0;                // Stamp of the last scan used.
  double latency_p50_ms = 0.0;         // Scan received to pose published, over the last 256.
  double latency_p99_ms = 0.0;
  std::uint64_t session = 0;  // The session of the numbers (SessionToken); 0 if none is open.
  Generation generation = 0;  // Set by the server's egress.

  [[nodiscard]] std::uint64_t dropped_total() const;
};

}  // namespace cairn
