// A question to the server and its answer, as plain values.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/map/map_edit.h"
#include "common/map/tile.h"
#include "common/sensor/trajectory.h"
#include "common/service/job.h"
#include "common/service/learned_value.h"
#include "common/service/ledger.h"
#include "common/service/map_info.h"
#include "common/service/pose_report.h"
#include "common/service/refusals.h"
#include "common/service/ros2_report.h"
#include "common/service/server_load.h"
#include "common/service/session.h"
#include "common/status.h"

namespace cairn {

enum class RequestKind : std::uint8_t {
  kPing = 0,
  kPose,           // robot; stamp or latest.
  kPath,           // robot; smoothed, or live: every pose so far, where it lies in the present map.
  kTiles,          // site; area, level, since_epoch + since_version. Or robot without site: what it alone has drawn.
  kLandmarks,      // site.
  kMapInfo,        // site, or all where empty.
  kStatus,         // Ledgers and session states; robot or all.
  kJobSubmit,      // site, job_kind, enable.
  kJobGet,         // job.
  kJobCancel,      // job.
  kJobList,        // site or all.
  kSessionEnd,     // robot.
  kMapEnable,      // site, map_version (an older version: roll back).
  kSavedList,      // The files of saved sites.
  kSiteSave,       // site, saved (the file's name; empty: the site's).
  kSiteLoad,       // saved, site (empty: as in the file).
  kSiteDelete,     // site, or saved: then that file.
  kRos2,           // What the door for ROS 2 robots sees.
  kRelocalise,     // robot; T_map_robot (where it is) or nothing (it is not known).
  kLocalise,       // robot: from now on it is only localised, in the map of its site.
  kMap,            // robot: it maps again.
  kMapEdits,       // site.
  kMapEditAdd,     // site, edit.
  kMapEditRemove,  // site, edit: only the id.
};
inline constexpr int kRequestKindCount = 24;
[[nodiscard]] std::string_view RequestKindName(RequestKind kind);
// Whether it changes something, and is therefore sent as a Command.
[[nodiscard]] bool IsCommand(RequestKind kind);

struct Area {
  double x_min_m = 0, y_min_m = 0, x_max_m = 0, y_max_m = 0;  // All 0: everywhere.
};

struct Request {
  // Not sent: which participant of the domain it came from, as the receiver of the message knows it. A client chooses
  // its own id, so that shares of the server's time go by this number. 0: not received.
  std::uint64_t asker = 0;
  // Not sent: when the server took it.
  std::chrono::steady_clock::time_point received = {};
  ClientId client = 0;
  std::int64_t sequence = 0;
  RequestKind kind = RequestKind::kPing;
  std::string site;
  std::string robot;
  bool latest = true;             // kPose.
  Stamp stamp = 0;                // kPose, where not latest.
  bool smoothed = false;          // kPath.
  Area area;                      // kTiles, kLandmarks.
  std::uint32_t level = 0;        // kTiles.
  std::uint32_t since_epoch = 0;  // kTiles: a different epoch than the map's means "send all".
  std::uint64_t since_version = 0;
  Generation since_generation = 0;  // The generation of both. If it is not the server's, all tiles are sent.
  std::uint64_t job = 0;
  JobKind job_kind = JobKind::kSmooth;
  bool enable = true;             // kJobSubmit: enable the map version it makes.
  std::uint32_t map_version = 0;  // kMapEnable.
  // kSiteSave, kSiteLoad, kSiteDelete: the name of a file in the server's directory of saved sites.
  std::string saved;
  std::optional<Pose2> T_map_robot;  // kRelocalise.
  MapEdit edit;                      // kMapEditAdd, kMapEditRemove.
  bool disagreement = false;         // kTiles: of the layer that says where robots differ.
};

// A request that changes something. It has a topic of its own, because DDS Security gives permissions by topic.
struct Command {
  Request request;
};

struct LandmarkReport {
  std::uint64_t id = 0;  // Of no other landmark of this robot now; it may be given to another one later.
  std::string robot;
  bool corner = false;  // False: the midpoint of a line that ends on both sides.
  Eigen::Vector2d p_map = Eigen::Vector2d::Zero();
  double direction_rad = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  std::uint32_t sightings = 0;
};

// A robot's session as `cairn status` shows it.
struct RobotStatus {
  SessionState session;
  bool alive = false;  // The client's liveliness lease holds.
  PoseReport pose;
  std::vector<Ledger> ledgers;             // One per sensor.
  std::vector<LearnedValue> learned = {};  // At most kMostLearned.
};

// A site as a file in the server's directory of saved sites.
struct SavedSite {
  std::string name;
  std::string site;  // Empty where the file cannot be read.
  std::uint64_t bytes = 0;
  Stamp saved = 0;  // By the server's clock.
};

// Large answers come in parts of < 64 KB each, `part` from 0; the one with `last` ends them.
struct Reply {
  ClientId client = 0;
  std::int64_t sequence = 0;
  std::uint32_t part = 0;
  bool last = true;
  Status status;  // kNotFound, kUnavailable ("not yet"), kOutOfRange ("never"), ...
  std::uint32_t map_epoch = 0;
  std::uint64_t map_version = 0;
  std::vector<PoseReport> poses;
  Trajectory path;
  std::vector<Tile> tiles;
  std::vector<LandmarkReport> landmarks;
  std::vector<MapInfo> maps;
  std::vector<RobotStatus> robots;
  std::vector<Job> jobs;
  std::string server_version;       // kPing.
  std::vector<SavedSite> saved;     // kSavedList; kSiteSave: the file that was written; kSiteLoad: that, as which site.
  std::vector<Refusals> refused;    // kStatus: one.
  std::vector<ServerLoad> load;     // kStatus: one.
  std::vector<Ros2DoorState> ros2;  // kRos2: one.
  std::vector<Ros2Namespace> ros2_namespaces;
  std::vector<MapEdit> edits;  // kMapEdits; kMapEditAdd: the one that was added.
  // kPose, latest: the places where the robot may be, the most believed one first; none while it is not localized.
  std::vector<PoseHypothesis> hypotheses;
  Generation generation = 0;  // Set by the server's egress.
};

}  // namespace cairn
