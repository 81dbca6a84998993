// One site: its joint map, its map versions, and what is published of them. Robots hand in changed chunks; twice a
// second (option) changed tiles are rendered, encoded, given the next version and published.
//
// Switching to another map version is atomic for readers: every session gets a correction through its own queue and
// continues on its part of that version; what they hand in meanwhile is kept aside; when all have answered, the whole
// map changes at once under epoch + 1, every tile is published again and tiles that are gone get tombstones.
// Thread rule: any thread may call; the work happens on the site's strand; readers get immutable snapshots.
#pragma once

#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "common/mutex.h"
#include "server/maps/joint_map.h"
#include "server/maps/map_snapshot.h"
#include "server/maps/map_versions.h"
#include "server/maps/maps_options.h"
#include "server/outbound.h"

namespace cairn::server {

struct SitePorts {
  std::function<bool(OutboundValue)> send;  // Never waits.
  // Hands a correction to a session; false (and no call to `done`) where the server no longer knows the session.
  std::function<bool(const std::string& site, SessionId, Correction&&)> correct;
};

// A switch of versions under way: complete when no session is awaited.
struct VersionSwitch {
  std::uint32_t version = 0;
  std::set<SessionId> awaited;
  std::map<SessionId, slam::OccupancyGrid::Chunks> staged;  // The adopted sessions' new grids.
  std::map<SessionId, RobotGrid> displaced;
  std::function<void(Result<std::uint32_t>)> done;
};

class Site : public std::enable_shared_from_this<Site> {
 public:
  using Done = std::function<void(Result<std::uint32_t>)>;  // Gets a map version; called on the site's strand.

  Site(const std::string& name, double resolution_m, const MapsOptions& options, asio::thread_pool& pool,
       SitePorts ports);

  void Change(GridChange&& change);
  void SetRobots(std::uint32_t robots);
  // Adds a version, disabled; `done` gets its number.
  void AddVersion(MapVersion&& version, Done done);
  // UNAVAILABLE while another switch is under way; NOT_FOUND for a version that does not exist (any more).
  void Enable(std::uint32_t version, Done done);
  // Renders and publishes what changed.
  void Publish();
  // A no-op on the strand.
  void Probe(std::function<void()> done);

  [[nodiscard]] std::shared_ptr<const MapSnapshot> snapshot() const;

 private:
  class Ticket;

  template <typename Act>
  void Run(Act act);
  // Strand only from here.
  void Begin(std::uint32_t version, Done done);
  void Settle(std::uint32_t version, SessionId session, std::optional<Adopted>&& adopted);
  void StageGone(SessionId session);
  void CommitIfComplete();
  void Render();
  void RenderAll();
  void Refresh(const std::vector<TileKey>& changed, bool all);
  void Send();
  MapInfo InfoOf(const std::map<TileKey, std::shared_ptr<const Tile>>& tiles) const;

  const std::string name_;
  const NameId site_id_;
  const double resolution_m_;
  const SitePorts ports_;
  asio::strand<asio::thread_pool::executor_type> strand_;

  // Strand only.
  JointMap joint_;
  MapVersions versions_;
  std::uint32_t epoch_ = 0;
  std::uint64_t tile_version_ = 0;
  std::uint32_t robots_ = 0;
  bool info_changed_ = true;
  std::optional<VersionSwitch> switch_;
  std::set<TileKey> unsent_;  // Tiles (or tombstones) to publish.

  mutable Mutex mutex_;
  std::shared_ptr<const MapSnapshot> snapshot_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
