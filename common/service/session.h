// A robot's request to stream into a site, and the server's answer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/service/generation.h"
#include "common/service/names.h"
#include "common/status.h"

namespace cairn {

using ClientId = std::uint64_t;  // Random, non-zero, one per client process; tells two robots of one name apart.
// Identifies a session: random and non-zero, drawn by the client that opens it. Every sample contains it, because
// sequence numbers are counted within a session.
using SessionToken = std::uint64_t;

struct SessionRequest {
  std::string robot;
  std::string site;
  std::vector<std::string> sensors;  // Names of the streams to come; at most 16.
  ClientId client = 0;
  bool has_start = false;   // False: the site's origin for its first robot.
  Pose2 T_map_robot_start;  // Where the robot stands when it opens the session.
  bool end = false;         // Ends the session for good: its trajectory is complete.
  SessionToken session = 0;
  bool started = false;  // Samples were sent in this session before: it can be resumed, but not opened again.
  // The map in which the start was known (SessionState::map_frame). In another one it is not believed. 0: it does not
  // come from a map; a person or a program says it.
  std::uint64_t map_frame = 0;
};

enum class SessionPhase : std::uint8_t { kActive = 0, kRefused = 1, kEnded = 2, kSuspended = 3 };
[[nodiscard]] std::string_view SessionPhaseName(SessionPhase phase);

struct SessionState {
  NameId robot_id = 0;
  ClientId client = 0;  // The owner, or the client that is refused.
  std::string robot;
  std::string site;
  SessionPhase phase = SessionPhase::kActive;
  Status status;  // Why refused.
  SessionToken session = 0;
  bool durable = false;        // The server stores the samples.
  bool localise_only = false;  // Nothing is drawn of it (RequestKind::kLocalise).
  bool fragment = false;       // Not joined with the map of its site: its poses are in a frame of its own.
  bool stale = false;          // A stream stands still although the robot's client is alive; `status` says which.
  Generation generation = 0;   // Set by the server's egress.
  // A random number of the site's coordinate frame `map`, never 0. Poses in maps with different numbers cannot be
  // compared.
  std::uint64_t map_frame = 0;
};

// The answer to a refused request: the request's client and session, phase kRefused and the reason.
struct SessionRefusal {
  SessionState state;
};

}  // namespace cairn
