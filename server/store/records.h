// The stored records as C++ values, and their bytes (idl/cairn/record.proto). This folder does not depend on the
// estimator: grids are shared arrays of cells, and checkpoints are bytes. Functions that read check everything on which
// the rest of the server relies, because a file may contain anything. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/map/map_edit.h"
#include "common/map/tile.h"
#include "common/sensor/trajectory.h"
#include "common/service/job.h"
#include "common/service/ledger.h"
#include "common/service/session.h"
#include "common/service/stream.h"

namespace cairn::server {

// A robot's grid: for each chunk its place and kTileArea cells of log odds. The cells are immutable and shared.
struct StoredChunk {
  int x = 0;
  int y = 0;
  std::shared_ptr<const std::int16_t> cells;
};
struct StoredGrid {
  std::uint64_t keyframes = 0;
  std::vector<StoredChunk> chunks;
  std::shared_ptr<const std::vector<Pose2>> path{};  // T_map_robot of the keyframes; null: not known.
  // The numbers of the keyframes of the path, increasing; null: 0, 1, 2, ...
  std::shared_ptr<const std::vector<std::uint64_t>> numbers{};
  std::shared_ptr<const std::vector<Pose2>> drawn{};  // At which they are in the grid; null: those of the path.
  bool fragment = false;                              // Not joined with the map of the site.
};

// The entries of a session's journal: the events that its strand processed, in this order.
struct ScanTaken {
  StreamId stream;
  std::shared_ptr<const Scan> scan;
};
// A scan that was counted in the ledger but not given to the estimator.
struct ScanRefused {
  StreamId stream;
  std::uint64_t sequence = 0;
  DropReason reason = DropReason::kNoOdometry;
};
enum class OdometryUse : std::uint8_t { kTaken = 0, kRefused = 1, kMerged = 2 };
struct OdometryTaken {
  StreamId stream;
  Odometry odometry;
  OdometryUse use = OdometryUse::kTaken;
};
// From now on this client owns the session. It streams these sensors, and those named before, under its token.
struct OwnerChanged {
  ClientId client = 0;
  SessionToken session = 0;
  std::vector<std::string> sensors;
};
// A grid from a finished job was adopted. Kept as data, because the job is not run again when a journal is replayed.
struct CorrectionTaken {
  std::uint32_t epoch = 0;
  std::uint64_t generation = 0;
  StoredGrid grid;
};
// The epoch of the map changed, and nothing of this session.
struct EpochChanged {
  std::uint32_t epoch = 0;
};
// Somebody said that the robot has to be found again, and perhaps where it is.
struct RelocaliseTaken {
  std::optional<Pose2> T_map_robot;
};
// The robot is only localised from now on, in this map: the tiles of level 0 as the site has published them, and the
// epoch of the map. Or it `maps_again`.
struct LocaliseTaken {
  bool maps_again = false;
  std::vector<std::shared_ptr<const Tile>> tiles;
  double resolution_m = 0.0;
  std::uint32_t epoch = 0;
};
// A job has found a robot whose place was not known: it was at this pose when it saw the scan of this stamp. Its next
// scans confirm that in the `map` around that pose. It takes the place of an earlier one. While such a place waits for
// the scans, it is repeated after each checkpoint, which does not hold it. Without tiles: no place is looked at any
// more.
struct PlaceSuggested {
  Stamp seen = 0;
  Pose2 T_map_robot;
  LocaliseTaken map;
};
// The robot is not where it was said to start: from now on it is a fragment.
struct StartRefusal {
  std::string why;
};
struct SessionFinished {
  bool final = true;
  Status status;
};
using JournalEntry = std::variant<ScanTaken, ScanRefused, OdometryTaken, OwnerChanged, CorrectionTaken, EpochChanged,
                                  RelocaliseTaken, LocaliseTaken, PlaceSuggested, StartRefusal, SessionFinished>;

struct StoredSession {
  std::uint64_t id = 0;
  SessionRequest request;
  std::uint32_t map_epoch = 0;
  bool fragment = false;  // It began without being joined with the map of the site.
  // Since when its robot is away, or it has ended: milliseconds since 1970. 0: neither, or not known.
  std::uint64_t quiet_since_ms = 0;
  bool map_begun = false;  // When it began, others had begun the map: it matters where it is in it.
};

// The path of a robot after smoothing, and the session that drove it: the robot may have begun another since.
struct SmoothedPath {
  std::uint64_t session = 0;  // 0: an older server did not say.
  std::shared_ptr<const Trajectory> path;
};
using SmoothedPaths = std::map<std::string, SmoothedPath>;  // By robot.

struct StoredVersion {
  std::uint32_t version = 0;
  std::uint64_t job = 0;
  std::string note;
  std::map<std::uint64_t, StoredGrid> parts;  // By session id.
  SmoothedPaths smoothed;
};

// The switches of a map that were completed: epoch -> generation of the server that began it. Only the newest are kept;
// all before them count as completed.
using Switches = std::map<std::uint32_t, std::uint64_t>;
inline constexpr std::size_t kMostSwitches = 1024;
[[nodiscard]] inline bool IsCompleted(const Switches& switches, std::uint32_t epoch, std::uint64_t generation) {
  if (switches.size() >= kMostSwitches && epoch < switches.begin()->first) return true;
  const auto made = switches.find(epoch);
  return made != switches.end() && made->second == generation;
}

// Of a site. The server allows half as many (maps.max_edits), and two sites can be merged.
inline constexpr std::size_t kMostStoredEdits = 8192;
inline constexpr std::uint64_t kMaxEditsVersion = std::uint64_t{1} << 53;

// How much a site has given up so far to stay below its limit of memory (maps/memory_keeper.h).
struct GivenUp {
  std::uint32_t versions = 0;  // Map versions that were removed.
  std::uint32_t layers = 0;    // Layers of earlier sessions that became part of another one.
  std::uint32_t sessions = 0;  // Earlier sessions of which only the layer was kept.
};

// The keyframes with which an edit of the map moves (maps/edit_anchors.h).
struct EditAnchor {
  std::uint64_t session = 0;
  std::uint64_t keyframe = 0;   // Its number (slam/trail/keyframe.h).
  Pose2 T_map_then, T_map_now;  // T_map_robot of the keyframe when the edit was anchored, and now.

  bool operator==(const EditAnchor&) const = default;
};
struct EditAnchors {
  std::vector<Eigen::Vector2d> points_then;  // The points of the edit when it was anchored, in the map frame.
  std::vector<EditAnchor> keyframes;         // At most kMostEditPoints; none: the edit does not move.

  bool operator==(const EditAnchors&) const = default;
};

struct StoredSite {
  std::string name;
  std::uint32_t epoch = 0;
  std::uint64_t tile_version = 0;
  std::uint32_t next_version = 2;
  std::uint32_t enabled_version = 1;
  Switches switches;
  std::map<NameId, std::uint64_t> members;  // Robot -> the session that draws for it.
  double resolution_m = 0.0;                // Side of the map's cells; 0: not known.
  std::set<std::uint64_t> fragments;        // Sessions that are not joined with the map.
  std::vector<std::uint64_t> past;          // Sessions that have ended, in the order in which they did.
  std::set<std::uint64_t> merged{};         // Layers that stand for several sessions.
  std::uint64_t map_frame = 0;              // SessionState::map_frame; 0: stored without one.
  std::vector<MapEdit> edits{};             // By people, in the order in which they were made,
  std::uint64_t edits_version = 0;          // and how often they were changed; no number of an edit is higher.
  // By the number of the edit. An edit without an entry hangs on no keyframe.
  std::map<std::uint64_t, EditAnchors> anchors{};
  GivenUp given_up{};
  bool chosen = false;                   // A person has chosen the enabled version.
  std::set<std::uint64_t> kept_apart{};  // Fragments that a person has taken out of the map.
};

struct StoredLayer {
  std::uint64_t session = 0;
  StoredGrid grid;
};

struct StoredJob {
  Job job;
  bool enable = true;  // Whether to enable the map version that it makes.
  // How often it was begun, but for those times in which the server was stopped in good order meanwhile.
  std::uint32_t attempts = 0;
};

[[nodiscard]] std::string BytesOf(std::uint64_t first, const std::vector<JournalEntry>& entries);
[[nodiscard]] std::string BytesOf(const StoredSession& session);
[[nodiscard]] std::string BytesOf(const StoredVersion& version);
[[nodiscard]] std::string BytesOf(const StoredSite& site);
[[nodiscard]] std::string BytesOf(const StoredLayer& layer);
[[nodiscard]] std::string BytesOf(const StoredJob& job);

// DATA_LOSS: the bytes are no such record, or hold values that no server writes.
struct StoredBatch {
  std::uint64_t first = 0;
  std::vector<JournalEntry> entries;
};
[[nodiscard]] Result<StoredBatch> BatchOf(std::string_view bytes);
[[nodiscard]] Result<StoredSession> SessionOf(std::string_view bytes);
[[nodiscard]] Result<StoredVersion> VersionOf(std::string_view bytes);
[[nodiscard]] Result<StoredSite> SiteOf(std::string_view bytes);
[[nodiscard]] Result<StoredLayer> LayerOf(std::string_view bytes);
[[nodiscard]] Result<StoredJob> JobOf(std::string_view bytes);

}  // namespace cairn::server
