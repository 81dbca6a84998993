#include "server/maps/site.h"

#include <algorithm>
#include <asio/post.hpp>
#include <cmath>
#include <utility>

#include "server/maps/tile_encoding.h"

namespace cairn::server {

// One session's answer to a correction. A session that goes away without answering drops the ticket, and its destructor
// answers instead: a switch never waits for ever.
class Site::Ticket {
 public:
  Ticket(std::shared_ptr<Site> site, std::uint32_t version, SessionId session)
      : site_(std::move(site)), version_(version), session_(session) {}
  Ticket(const Ticket&) = delete;
  Ticket& operator=(const Ticket&) = delete;
  ~Ticket() {
    if (!used_) Answer(std::nullopt);
  }
  void Answer(std::optional<Adopted> adopted) {
    used_ = true;
    site_->Run([version = version_, session = session_, adopted = std::move(adopted)](Site& site) mutable {
      site.Settle(version, session, std::move(adopted));
    });
  }

 private:
  const std::shared_ptr<Site> site_;
  const std::uint32_t version_;
  const SessionId session_;
  bool used_ = false;
};

Site::Site(const std::string& name, double resolution_m, const MapsOptions& options, asio::thread_pool& pool,
           SitePorts ports)
    : name_(name),
      site_id_(HashName(name)),
      resolution_m_(resolution_m),
      ports_(std::move(ports)),
      strand_(asio::make_strand(pool)),
      versions_(static_cast<std::size_t>(options.max_versions)) {
  auto empty = std::make_shared<MapSnapshot>();
  empty->info = InfoOf({});
  const MutexLock lock(mutex_);
  snapshot_ = std::move(empty);
}

template <typename Act>
void Site::Run(Act act) {
  asio::post(strand_, [self = shared_from_this(), act = std::move(act)]() mutable { act(*self); });
}

void Site::Change(GridChange&& change) {
  Run([change = std::move(change)](Site& site) {
    if (site.switch_) {
      const auto staged = site.switch_->staged.find(change.session);
      if (staged != site.switch_->staged.end()) {
        for (const auto& [key, chunk] : change.chunks) {
          if (chunk != nullptr) staged->second.insert_or_assign(key, chunk);
          if (chunk == nullptr) staged->second.erase(key);
        }
        return;
      }
    }
    site.joint_.Apply(change);
  });
}

void Site::SetRobots(std::uint32_t robots) {
  Run([robots](Site& site) {
    site.robots_ = robots;
    site.info_changed_ = true;
  });
}

void Site::AddVersion(MapVersion&& version, Done done) {
  Run([version = std::move(version), done = std::move(done)](Site& site) mutable {
    const std::uint32_t number = site.versions_.Add(std::move(version));
    site.Refresh({}, false);
    site.Send();
    done(number);
  });
}

void Site::Enable(std::uint32_t version, Done done) {
  Run([version, done = std::move(done)](Site& site) mutable { site.Begin(version, std::move(done)); });
}

void Site::Publish() {
  Run([](Site& site) {
    site.Render();
    site.Send();
  });
}

void Site::Probe(std::function<void()> done) {
  Run([done = std::move(done)](Site&) { done(); });
}

std::shared_ptr<const MapSnapshot> Site::snapshot() const {
  const MutexLock lock(mutex_);
  return snapshot_;
}

void Site::Begin(std::uint32_t version, Done done) {
  if (switch_) {
    return done(Fail(StatusCode::kUnavailable, "another map version is being enabled; try again"));
  }
  const MapVersion* const wanted = versions_.Find(version);
  if (wanted == nullptr) {
    return done(Fail(StatusCode::kNotFound, "site '" + name_ + "' has no map version " + std::to_string(version)));
  }
  if (version == versions_.enabled()) return done(version);
  switch_.emplace();
  switch_->version = version;
  switch_->done = std::move(done);
  for (const auto& [session, part] : wanted->parts) {
    switch_->awaited.insert(session);
    const auto ticket = std::make_shared<Ticket>(shared_from_this(), version, session);
    Correction correction{
        .epoch = epoch_ + 1, .grid = part, .done = [ticket](Adopted&& adopted) { ticket->Answer(std::move(adopted)); }};
    // A session that is gone drops the correction, and with it the ticket.
    static_cast<void>(ports_.correct(name_, session, std::move(correction)));
  }
  CommitIfComplete();
}

void Site::Settle(std::uint32_t version, SessionId session, std::optional<Adopted>&& adopted) {
  if (!switch_ || switch_->version != version || switch_->awaited.erase(session) == 0) return;
  if (adopted) {
    slam::OccupancyGrid::Chunks& staged = switch_->staged[session];
    for (const auto& [key, chunk] : adopted->change.chunks) {
      if (chunk != nullptr) staged.emplace(key, chunk);
    }
    switch_->displaced.emplace(session, std::move(adopted->displaced));
  } else {
    StageGone(session);
  }
  CommitIfComplete();
}

void Site::StageGone(SessionId session) {
  const RobotGrid& part = versions_.Find(switch_->version)->parts.at(session);
  switch_->staged.emplace(session, part.chunks);
  switch_->displaced.emplace(session, RobotGrid{joint_.ChunksOf(session), part.keyframes});
}

void Site::CommitIfComplete() {
  if (!switch_->awaited.empty()) return;
  VersionSwitch complete = std::move(*switch_);
  switch_.reset();
  for (const auto& [session, chunks] : complete.staged) joint_.Replace(session, chunks);
  versions_.Enable(complete.version, std::move(complete.displaced));
  ++epoch_;
  RenderAll();
  Send();
  complete.done(complete.version);
}

void Site::Render() {
  const std::vector<TileKey> changed = joint_.Render();
  if (!changed.empty() || info_changed_) Refresh(changed, false);
}

void Site::RenderAll() {
  Refresh(joint_.Render(), true);
}

void Site::Refresh(const std::vector<TileKey>& changed, bool all) {
  const std::shared_ptr<const MapSnapshot> before = snapshot();
  auto after = std::make_shared<MapSnapshot>();
  after->tiles = before->tiles;
  after->smoothed = versions_.smoothed();
  if (!changed.empty() || all) ++tile_version_;
  for (const TileKey& key : changed) {
    unsent_.insert(key);
    const auto cells = joint_.cells().find(key);
    if (cells == joint_.cells().end()) {
      after->tiles.erase(key);
    } else {
      after->tiles[key] = EncodeTile(key, *cells->second, epoch_, tile_version_);
    }
  }
  if (all) {
    for (auto& [key, tile] : after->tiles) {
      unsent_.insert(key);
      if (tile->epoch != epoch_) tile = Restamp(*tile, epoch_, tile_version_);
    }
  }
  after->info = InfoOf(after->tiles);
  info_changed_ = true;
  const MutexLock lock(mutex_);
  snapshot_ = std::move(after);
}

void Site::Send() {
  const std::shared_ptr<const MapSnapshot> now = snapshot();
  if (info_changed_) info_changed_ = !ports_.send(now->info);
  while (!unsent_.empty()) {
    const TileKey key = *unsent_.begin();
    const auto tile = now->tiles.find(key);
    TileSample sample{.site_id = site_id_, .tile = {}, .deleted = tile == now->tiles.end()};
    if (sample.deleted) {
      sample.tile = {
          .key = key, .epoch = epoch_, .version = tile_version_, .encoding = TileEncoding::kRaw, .bytes = {}};
    } else {
      sample.tile = *tile->second;
    }
    if (!ports_.send(std::move(sample))) return;  // The lane is full: the rest at the next turn.
    unsent_.erase(unsent_.begin());
  }
}

MapInfo Site::InfoOf(const std::map<TileKey, std::shared_ptr<const Tile>>& tiles) const {
  MapInfo info;
  info.site_id = site_id_;
  info.site = name_;
  info.resolution_m = resolution_m_;
  info.epoch = epoch_;
  info.version = tile_version_;
  info.levels = kPyramidLevels;
  info.robots = robots_;
  info.enabled_version = versions_.enabled();
  info.versions = versions_.infos();
  const double tile_m = kTileCells * resolution_m_;
  for (const auto& [key, tile] : tiles) {
    if (key.level != 0) break;  // Keys are ordered by level.
    const double x_min = key.x * tile_m, y_min = key.y * tile_m;
    const bool first = info.tile_count++ == 0;
    info.x_min_m = first ? x_min : std::min(info.x_min_m, x_min);
    info.y_min_m = first ? y_min : std::min(info.y_min_m, y_min);
    info.x_max_m = first ? x_min + tile_m : std::max(info.x_max_m, x_min + tile_m);
    info.y_max_m = first ? y_min + tile_m : std::max(info.y_max_m, y_min + tile_m);
  }
  return info;
}

}  // namespace cairn::server
