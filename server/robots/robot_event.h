// Everything that reaches a robot's estimator. Streams, corrections of finished jobs, requests for a snapshot and the
// end of the session all come as events of one queue, and are handled in the order of that queue.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/inbound.h"
#include "server/maps/map_snapshot.h"
#include "server/maps/robot_grid.h"
#include "server/robots/receipt.h"
#include "server/slam/known_grid/known_grid.h"
#include "server/slam/mapper.h"
#include "server/slam/recovery/recovery_options.h"
#include "server/slam/trail/keyframe.h"
#include "server/store/records.h"

namespace cairn::server {

// The state of a session at one moment, for a job. Immutable, so that threads may share it.
struct SessionMaterial {
  SessionId session = 0;
  std::string robot;
  slam::MapperSnapshot snapshot;
  slam::GridOptions grid_options;
  // Whether the place of its start in the map is known: somebody has said where it is, the session began the map, or a
  // map version has joined it (maps/robot_grid.h).
  bool start_known = true;
  bool start_found = false;  // It began without one, or that was refused; and a map version has joined it.
  bool joinable = true;      // See SessionRecord::Joining.
  slam::Mapper::LostView lost{};
  // With which the session itself would make the map of a PlaceSuggested ready for use (KnownGridOf).
  slam::PlaceSearchOptions place_search{};
  double near_m = 0.0;
};

struct SnapshotWanted {
  std::function<void(SessionMaterial&&)> done;  // Called on the session's strand.
};

// Somebody says that the robot is not where it is believed to be, and perhaps where it is (slam::Mapper::Relocalise).
struct RelocaliseWanted {
  std::optional<Pose2> T_map_robot;
  std::shared_ptr<Receipt> receipt{};  // Null: nobody is told.
};

// A job has looked for the robot in the map of its site.
struct PlaceFound {
  std::optional<PlaceSuggested> place;  // If there is only one place where the robot can be.
  // The map of `place`, made ready for use with the options of the SessionMaterial. That takes so long for a large area
  // that the session's scans would wait. Null: there is no place, or its map is too large.
  std::shared_ptr<const slam::KnownGrid> map{};
  std::vector<PoseHypothesis> places;      // All where it may be, for queries.
  std::function<void(bool taken)> done{};  // Called once: whether the robot's scans will confirm the place, or not.
};

// From now on the robot is only localised, in this map; null: it maps again. `again`: the map of a robot that is only
// localised already has changed; for one that maps meanwhile it is left out.
struct LocaliseWanted {
  std::shared_ptr<const MapSnapshot> map;
  bool again = false;
  std::shared_ptr<Receipt> receipt{};  // Null: nobody is told.
};

// What others have drawn contradicts the place where the robot is said to have started (jobs/start_check.h).
struct StartRefused {
  std::string why;
};

// The end of a session. Scans that arrived before it are finished first. `final` is true if the session is over, and
// false if the server stops and the session could go on later.
// The epoch of the map has changed, and what this session draws has not.
struct EpochChange {
  std::uint32_t epoch = 0;
};

struct Finish {
  bool final = true;  // False: the server stops, or the end was asked for before.
  Status reason = {};
  std::function<void()> done;
};

using RobotEvent = std::variant<ScanArrival, OdometryArrival, Correction, EpochChange, SnapshotWanted, RelocaliseWanted,
                                LocaliseWanted, PlaceFound, StartRefused, Finish>;

}  // namespace cairn::server
