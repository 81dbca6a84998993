// Everything that reaches a robot's estimator, in the order it is to be handled. One front door: streams, corrections
// of finished jobs, requests for a snapshot, and the end all come as events of the same queue.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "server/inbound.h"
#include "server/slam/keyframe.h"
#include "server/slam/mapper.h"

namespace cairn::server {

using SessionId = std::uint64_t;  // Unique for the server's life; grows.

// What a session knows at one moment, for a job: shared, immutable.
struct SessionMaterial {
  SessionId session = 0;
  std::string robot;
  slam::MapperSnapshot snapshot;
  slam::GridOptions grid_options;
};

// A robot's grid, drawn from its first `keyframes` keyframes: immutable chunks, shared.
struct RobotGrid {
  slam::OccupancyGrid::Chunks chunks;
  std::size_t keyframes = 0;
};

// Chunks of one session's grid that changed (null: gone).
struct GridChange {
  SessionId session = 0;
  std::vector<std::pair<slam::ChunkKey, std::shared_ptr<const slam::GridChunk>>> chunks;
};

// What a session answers to a correction: the grid it gave up and the one it now continues with.
struct Adopted {
  SessionId session = 0;
  RobotGrid displaced;
  GridChange change;  // Every chunk of both grids.
};

// A finished job's grid to continue with, valid from map epoch `epoch` on. `done` is called on the session's strand.
struct Correction {
  std::uint32_t epoch = 0;
  RobotGrid grid;
  std::function<void(Adopted&&)> done;
};

struct SnapshotWanted {
  std::function<void(SessionMaterial&&)> done;  // Called on the session's strand.
};

// Scans that arrived before it are finished first. `final`: the session is over; else the server stops.
struct Finish {
  bool final = true;
  std::function<void()> done;
};

// A no-op that shows the strand moves.
struct Probe {
  std::function<void()> done;
};

using RobotEvent = std::variant<ScanArrival, OdometryArrival, Correction, SnapshotWanted, Finish, Probe>;

}  // namespace cairn::server
