// One site: its joint map, its map versions, and their publication. Robots pass their changed chunks to the
// site. At maps.publish_rate_hz the changed tiles are rendered, encoded, given the next version number and
// published.
//
// A switch to another map version is atomic for readers. Every session gets a correction through its own
// queue and continues with its part of that version. Changes that the sessions send meanwhile are stored
// apart. When all sessions have answered, the whole map changes at once under epoch + 1: every tile is
// published again, and removed tiles are published as deleted.
// Thread rule: any thread may call; the work runs on the site's strand; readers get immutable snapshots. Work
// that ends with an exception is logged and dropped, and the site continues.
#pragma once

#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "common/mutex.h"
#include "common/service/generation.h"
#include "common/service/names.h"
#include "server/maps/joint_map.h"
#include "server/maps/map_snapshot.h"
#include "server/maps/map_versions.h"
#include "server/maps/maps_options.h"
#include "server/ops/heartbeat.h"
#include "server/outbound.h"
#include "server/store/journal.h"

namespace cairn::server {

// A version switch under way. It is complete when no session is awaited.
struct VersionSwitch {
  std::uint32_t version = 0;
  std::set<SessionId> awaited;
  std::map<SessionId, slam::OccupancyGrid::Chunks> staged;  // The new grids of the sessions that have answered.
  std::map<SessionId, RobotGrid> displaced;
  std::function<void(Result<std::uint32_t>)> done;
};

class Site : public std::enable_shared_from_this<Site> {
 public:
  // Receives a map version; called once, on the site's strand. INTERNAL if the work ended with an exception.
  using Done = std::function<void(Result<std::uint32_t>)>;

  // Where the site stands among those of its name that were deleted since the start: its epoch and its versions go on
  // above theirs, because a client may still know them.
  struct Beginning {
    std::uint32_t epoch = 0;
    std::uint64_t tile_version = 0;
  };

  // `journal`: null where nothing is stored. `generation`: of this start of the server.
  Site(const std::string& name, double resolution_m, const MapsOptions& options, asio::thread_pool& pool,
       Outbound& outbound, Journal* journal = nullptr, Generation generation = 0, const Beginning& beginning = {0, 0});

  // Goes on from what a server before this one has stored: epoch, versions, and the parts of sessions that exist no
  // more. Before anything else is called.
  Result<void> Restore(const StoredSite& stored);
  // Whether the server of this generation completed the switch that led to this epoch. Before the threads start.
  [[nodiscard]] bool Switched(std::uint32_t epoch, Generation generation) const;

  // From now on this session of the robot draws here, in place of the robot's previous session. A session
  // that has ended is kept while its GridOwner exists, because its part of the map can still be corrected.
  void Join(NameId robot, SessionId session, std::weak_ptr<GridOwner> owner);
  void Change(GridChange&& change);
  // The session exists no more. Its part of the map stays, and is stored as such instead of the session.
  void Leave(SessionId session);
  // The highest number of a session that exists no more and has a part here; 0: none. Before the threads start.
  [[nodiscard]] SessionId last_layer() const { return layers_.empty() ? 0 : *layers_.rbegin(); }
  // The site is deleted: from now on it stores nothing and publishes nothing. `done` receives what it had published
  // last, on the strand, when everything that was asked before is finished. A switch of the map version under way
  // fails.
  void Retire(std::function<void(std::shared_ptr<const MapSnapshot>)> done);
  // Adds a disabled version; `done` receives its number.
  void AddVersion(MapVersion&& version, Done done);
  // UNAVAILABLE: another switch is under way. NOT_FOUND: the version does not exist or has been removed.
  void Enable(std::uint32_t version, Done done);
  // Renders and publishes what changed.
  void Publish();
  // Does nothing but call `done` on the strand, to show that the strand makes progress.
  void Probe(std::function<void()> done);

  [[nodiscard]] std::shared_ptr<const MapSnapshot> snapshot() const;
  [[nodiscard]] Pulse pulse() const { return {handled_, handled_ != asked_}; }

 private:
  class Ticket;
  struct Member {
    SessionId session = 0;
    std::weak_ptr<GridOwner> owner;
  };

  template <typename Act>
  void Run(Act act);
  // The functions below run on the strand only.
  void Begin(std::uint32_t version, Done done);
  void Settle(std::uint32_t version, SessionId session, std::optional<Adopted>&& adopted);
  std::shared_ptr<GridOwner> OwnerOf(SessionId session) const;
  void StageGone(SessionId session);
  void CommitIfComplete();
  void Render();
  void RenderAll();
  void Refresh(const std::vector<TileKey>& changed, bool all);
  void Send();
  void StoreSite();
  void StoreVersion(std::uint32_t version);
  void StoreLayer(SessionId session);
  void RemoveOldVersions();
  Result<void> RestoreVersions(const StoredSite& stored);
  Result<void> RestoreLayers();
  MapInfo InfoOf(const std::map<TileKey, std::shared_ptr<const Tile>>& tiles) const;

  const std::string name_;
  const NameId site_id_;
  const double resolution_m_;
  Outbound& outbound_;
  const Generation generation_;
  asio::strand<asio::thread_pool::executor_type> strand_;

  // The members below are used on the strand only.
  Journal* journal_;  // Null where nothing is stored.
  bool retired_ = false;
  JointMap joint_;
  MapVersions versions_;
  std::uint32_t epoch_ = 0;
  std::uint64_t tile_version_ = 0;
  std::map<NameId, Member> members_;
  std::map<std::uint32_t, Generation> switches_;  // Epoch -> the server that switched the map to it.
  std::set<SessionId> layers_;                    // Sessions that exist no more, whose parts are stored.
  std::set<std::uint32_t> stored_versions_;
  bool info_changed_ = true;
  std::optional<VersionSwitch> switch_;
  std::set<TileKey> unsent_;  // Tiles (or tombstones) to publish.

  std::atomic<std::uint64_t> asked_{0}, handled_{0};  // Pieces of work posted to the strand, and finished on it.
  mutable Mutex mutex_;
  std::shared_ptr<const MapSnapshot> snapshot_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
