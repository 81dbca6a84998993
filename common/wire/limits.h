// Limits of length for all values on the wire. Longer values are dropped unread and counted. idl/README.md
// repeats the numbers for people who write clients.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/sensor/scan.h"

namespace cairn::wire {

inline constexpr std::size_t kMaxNameBytes = 64;
inline constexpr std::size_t kMaxTextBytes = 1024;  // Messages and notes for people.
inline constexpr std::size_t kMaxSensors = 16;
// Above the limit of ValidateScan, so that a scan with somewhat too many beams still reaches the ledger and
// is counted.
inline constexpr std::size_t kMaxRangesRead = 4 * static_cast<std::size_t>(kMaxBeams);
inline constexpr std::size_t kMaxTileBytes = 65535;
inline constexpr std::size_t kMaxDropReasons = 64;
inline constexpr std::size_t kMaxMapVersions = 1024;
inline constexpr int kMaxTileLevel = 15;

// The limits for one part of a reply.
inline constexpr std::size_t kMaxReplyPoses = 1024;
inline constexpr std::size_t kMaxReplyPath = 4096;
inline constexpr std::size_t kMaxReplyTiles = 1024;
inline constexpr std::size_t kMaxReplyLandmarks = 1024;
inline constexpr std::size_t kMaxReplyMaps = 256;
inline constexpr std::size_t kMaxReplyRobots = 256;
inline constexpr std::size_t kMaxReplyJobs = 1024;
inline constexpr std::size_t kMaxReplySaved = 1024;
inline constexpr std::size_t kMaxReplyNamespaces = 256;
inline constexpr std::size_t kMaxReplyEdits = 1024;
inline constexpr std::size_t kMaxRos2Problems = 16;
inline constexpr std::size_t kMaxRos2Topics = 64;

// A reader that comes late counts the numbers of all samples that a writer has ever written (idl/README.md): a million
// in less than 0.3 s, as measured. After so many a new writer takes over, whose numbers begin at 1.
inline constexpr std::uint64_t kMostWritten = 200'000;

// The size of one serialised sample. It bounds what a datagram can make the middleware allocate.
inline constexpr std::uint32_t kMaxSampleBytes = 256 * 1024;

}  // namespace cairn::wire
