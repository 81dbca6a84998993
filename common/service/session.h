// A robot's request to stream into a site, and the server's answer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/service/names.h"
#include "common/status.h"

namespace cairn {

using ClientId = std::uint64_t;  // Random, non-zero, one per client process; tells two robots of one name apart.

struct SessionRequest {
  std::string robot;
  std::string site;
  std::vector<std::string> sensors;  // Names of the streams to come; at most 16.
  ClientId client = 0;
  bool has_start = false;   // False: the site's origin for its first robot.
  Pose2 T_map_robot_start;  // Where the robot stands when it opens the session.
  bool end = false;         // Ends the session for good: its trajectory is complete.
};

enum class SessionPhase : std::uint8_t { kActive = 0, kRefused = 1, kEnded = 2, kSuspended = 3 };
[[nodiscard]] std::string_view SessionPhaseName(SessionPhase phase);

struct SessionState {
  NameId robot_id = 0;
  ClientId client = 0;
  std::string robot;
  std::string site;
  SessionPhase phase = SessionPhase::kActive;
  Status status;  // Why refused.
};

}  // namespace cairn
