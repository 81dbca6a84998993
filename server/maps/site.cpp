#include "server/maps/site.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <asio/post.hpp>
#include <exception>
#include <utility>

#include "server/maps/answer_once.h"
#include "server/maps/memory_shares.h"
#include "server/maps/tile_encoding.h"

namespace cairn::server {
namespace {

constexpr char kLeftAlone[] =
    "chosen by a person, so no job changes the map by itself until the next `cairn job smooth`";

}  // namespace

Site::Site(const std::string& name, double resolution_m, const MapsOptions& options, asio::thread_pool& pool,
           Outbound& outbound, Journal* journal, Generation generation, const Beginning& beginning)
    : name_(name),
      site_id_(HashName(name)),
      resolution_m_(resolution_m),
      outbound_(outbound),
      generation_(generation),
      strand_(asio::make_strand(pool)),
      journal_(journal),
      joint_(options.past_probability),
      edits_(resolution_m, static_cast<std::size_t>(options.max_edits)),
      versions_(static_cast<std::size_t>(options.max_versions)),
      memory_(BytesOfMib(options.max_memory_mib), options.max_memory_mib > 0.0 || options.max_total_memory_mib > 0.0),
      epoch_(beginning.epoch),
      tile_version_(beginning.tile_version),
      map_frame_(beginning.map_frame) {
  auto empty = std::make_shared<MapSnapshot>();
  empty->info = InfoOf({});
  const MutexLock lock(mutex_);
  snapshot_ = std::move(empty);
}

void Site::LogFailure(const std::exception& error) const {
  spdlog::error("site {}: a piece of work failed with an exception and was dropped: {}", name_, error.what());
}

void Site::Change(GridChange&& change) {
  const MutexLock lock(mutex_);
  if (waiting_ != nullptr) return Merge(std::move(change), *waiting_);
  const auto changes = std::make_shared<Changes>();
  Merge(std::move(change), *changes);
  Post([changes](Site& site) {
    {
      const MutexLock reading(site.mutex_);
      if (site.waiting_ == changes) site.waiting_.reset();
    }
    // `changes` is final now.
    for (const auto& [session, drawing] : *changes) site.Apply(session, drawing);
  });
  waiting_ = changes;  // Only now: nobody takes what was not posted.
}

void Site::Merge(GridChange&& change, Changes& into) {
  Drawing& newest = into[change.session];
  for (auto& [key, chunk] : change.chunks) newest.chunks.insert_or_assign(key, std::move(chunk));
  for (const auto& [key, cells] : change.looks) newest.looks[key] |= cells;
  if (change.drawn.path != nullptr) newest.drawn = std::move(change.drawn);
}

void Site::Apply(SessionId session, const Drawing& drawing) {
  if (switch_) {
    const auto staged = switch_->staged.find(session);
    if (staged != switch_->staged.end()) {
      if (drawing.drawn.path != nullptr) switch_->drawn[session] = drawing.drawn;
      for (const auto& [key, chunk] : drawing.chunks) {
        if (chunk != nullptr) staged->second.insert_or_assign(key, chunk);
        if (chunk == nullptr) staged->second.erase(key);
      }
      return;
    }
  }
  joint_.Apply({.session = session, .chunks = {drawing.chunks.begin(), drawing.chunks.end()}, .looks = drawing.looks});
  FollowPaths({{session, drawing.drawn}});
}

void Site::Join(Member member) {
  Run([member = std::move(member)](Site& site) {
    site.members_[member.session] = member;
    std::erase_if(site.members_, [](const auto& one) { return one.second.owner.expired(); });
    site.joint_.SetHidden(member.session, member.fragment);
    if (member.ended) site.joint_.SetPast(member.session);
    site.info_changed_ = true;
    if (member.fragment) site.ForgetPath(member.session);
    static_cast<void>(site.AnchorNew());
    site.StoreSite();
    // The map may have been switched since the session was made, or since the server that made it was killed.
    if (member.epoch == site.epoch_ || site.GiveMissedPart(member)) return;
    if (const auto known = member.owner.lock()) known->SetMapEpoch(site.epoch_);
  });
}

void Site::CheckStart(SessionId session, const Pose2& T_map_robot_start, Refuses refuses) {
  Run([session, T_map_robot_start, refuses = std::move(refuses)](Site& site) {
    GridAgreement agreement;
    if (!site.switch_)
      agreement = CompareGrids(site.joint_.ChunksOf(session), site.joint_.DrawnBefore(session), T_map_robot_start,
                               site.resolution_m_);
    if (refuses(agreement)) site.SetHidden(session);
  });
}

void Site::Hide(SessionId session) {
  Run([session](Site& site) { site.SetHidden(session); });
}

void Site::SetHidden(SessionId session) {
  joint_.SetHidden(session, true);
  ForgetPath(session);
  info_changed_ = true;
  StoreSite();
}

void Site::AdoptFrame(std::uint64_t map_frame) {
  map_frame_ = map_frame;
  Run([](Site& site) { site.StoreSite(); });
}

void Site::AddVersion(MapVersion&& version, Done done, Wanted wanted) {
  Run([version = std::move(version), done = Once<std::uint32_t>(std::move(done)),
       wanted = std::move(wanted)](Site& site) mutable {
    if (wanted && !wanted()) return done(Fail(StatusCode::kCancelled, "no longer wanted"));
    // A session that has left meanwhile may have no layer of its own any more: the layers stay as they are.
    std::erase_if(version.parts, [&site](const auto& part) {
      const SessionId session = part.first;
      return site.merged_.contains(session) ||
             (site.OwnerOf(session) == nullptr && site.joint_.ChunksOf(session).empty());
    });
    const std::uint32_t number = site.versions_.Add(std::move(version), site.switch_ ? site.switch_->version : 0);
    site.StoreTogether([&] {
      site.StoreVersion(number);
      site.RemoveOldVersions();
      site.StoreSite();
    });
    site.memory_.NoteNewVersion(Clock::now());
    site.Refresh({}, {}, false);
    site.Send();
    done(number);
  });
}

bool Site::MayBeAligned() const {
  const MapInfo info = snapshot()->info;
  const bool newest = std::none_of(info.versions.begin(), info.versions.end(),
                                   [&info](const MapVersionInfo& one) { return one.version > info.enabled_version; });
  return newest && !chosen_;
}

void Site::Enable(std::uint32_t version, Done done, Wanted wanted, EnabledBy by) {
  Run([version, by, done = Once<std::uint32_t>(std::move(done)), wanted = std::move(wanted)](Site& site) mutable {
    if (by == EnabledBy::kAlignment && site.chosen_)
      return done(Fail(StatusCode::kFailedPrecondition, "a person has chosen the enabled map version"));
    if (wanted && !wanted()) return done(Fail(StatusCode::kCancelled, "no longer wanted"));
    if (site.switch_) {
      return done(Fail(StatusCode::kUnavailable, "another map version is being enabled; try again later"));
    }
    try {
      site.Begin(version, std::move(done), by);
    } catch (...) {
      site.switch_.reset();  // Otherwise no other switch could ever begin.
      throw;
    }
  });
}

void Site::Retire(std::function<void(std::shared_ptr<const MapSnapshot>)> done) {
  Run([done = std::move(done)](Site& site) {
    site.FailSwitch(StatusCode::kNotFound, "site '" + site.name_ + "' was deleted");
    site.journal_ = nullptr;
    site.retired_ = true;
    done(site.snapshot());
  });
}

void Site::Close(std::function<void()> done) {
  publish_waits_ = false;  // A call that waits may come before the last changes.
  Publish();
  Run([done = std::move(done)](Site& site) {
    site.members_.clear();
    done();
    site.FailSwitch(StatusCode::kUnavailable, "the server is stopping");
  });
}

void Site::End(SessionId session) {
  Run([session](Site& site) {
    site.joint_.SetPast(session);
    site.StoreSite();
  });
}

void Site::Leave(SessionId session) {
  Run([session](Site& site) {
    site.StoreTogether([&] {
      {
        const MutexLock lock(site.mutex_);
        site.kept_apart_.erase(session);
      }
      site.KeepAsLayer(session);
      site.together_->forgotten.push_back(session);
    });
  });
}

void Site::Publish(std::function<void()> then, Clock::time_point now) {
  if (publish_waits_.exchange(true)) {
    if (then) then();
    return;
  }
  try {
    Run([then = std::move(then), now](Site& site) {
      site.publish_waits_ = false;
      site.ExpireDisagreement(now);
      site.Render();
      site.StayWithinMemory(now);
      site.Send();
      if (then) then();
    });
  } catch (...) {
    publish_waits_ = false;  // Otherwise nothing would ever be published again.
    throw;
  }
}

void Site::Probe(std::function<void()> done) {
  Run([done = std::move(done)](Site&) { done(); });
}

void Site::Render() {
  const std::vector<TileKey> changed = joint_.Render(), differing = RenderDisagreement();
  if (!changed.empty() || !differing.empty() || info_changed_ || memory_.IsToBeCounted(Clock::now()))
    Refresh(changed, differing, false);
}

void Site::RenderAll() {
  const std::vector<TileKey> changed = joint_.Render(), differing = RenderDisagreement();
  Refresh(changed, differing, true);
}

std::map<TileKey, TileSet::TilePtr> Site::Encoded(const std::vector<TileKey>& changed,
                                                  const std::map<TileKey, JointMap::Cells>& cells,
                                                  const TileSet& before, bool all) {
  std::map<TileKey, TileSet::TilePtr> tiles;
  for (const TileKey& key : changed) {
    const auto of_key = cells.find(key);
    tiles[key] = of_key == cells.end() ? nullptr : EncodeTile(key, *of_key->second, epoch_, tile_version_);
    ++encoded_;
  }
  for (int level = 0; all && level < kPyramidLevels; ++level) {
    before.ForEach(level, [&](const TileSet::TilePtr& tile) {
      if (!tiles.contains(tile->key)) tiles[tile->key] = Restamp(*tile, epoch_, tile_version_);
    });
  }
  return tiles;
}

void Site::Refresh(const std::vector<TileKey>& changed, const std::vector<TileKey>& differing, bool all) {
  const std::shared_ptr<const MapSnapshot> before = snapshot();
  auto after = std::make_shared<MapSnapshot>();
  after->smoothed = versions_.smoothed();
  after->edits = edits_.all();
  after->drawn = joint_.drawn();
  if (!changed.empty() || all) {
    ++tile_version_;
    StoreSite();
  }
  const auto tiles = Encoded(changed, joint_.cells(), before->tiles, all);
  for (const auto& [key, tile] : tiles) unsent_.insert(key);
  after->tiles = before->tiles.With(tiles);
  after->disagreement = before->disagreement.With(Encoded(differing, joint_.disagreement(), before->disagreement, all));
  after->info = InfoOf(after->tiles);
  CountMemory(*after);
  after->info.memory_bytes = memory_.bytes();
  after->info.memory_note = memory_.note();
  info_changed_ = true;
  const MutexLock lock(mutex_);
  snapshot_ = std::move(after);
}

void Site::Send() {
  if (retired_) return;
  const std::shared_ptr<const MapSnapshot> now = snapshot();
  if (info_changed_) info_changed_ = !outbound_.Send(now->info);
  while (!unsent_.empty()) {
    const TileKey key = *unsent_.begin();
    const TileSet::TilePtr tile = now->tiles.Find(key);
    TileSample sample{.site_id = site_id_, .tile = {}, .deleted = tile == nullptr};
    if (sample.deleted) {
      sample.tile = {
          .key = key, .epoch = epoch_, .version = tile_version_, .encoding = TileEncoding::kRaw, .bytes = {}};
    } else {
      sample.tile = *tile;
    }
    if (!outbound_.Send(std::move(sample))) return;  // The lane is full; the rest is sent at the next call.
    unsent_.erase(unsent_.begin());
  }
}

MapInfo Site::InfoOf(const TileSet& tiles) const {
  MapInfo info;
  info.site_id = site_id_;
  info.site = name_;
  info.resolution_m = resolution_m_;
  info.epoch = epoch_;
  info.version = tile_version_;
  info.levels = kPyramidLevels;
  std::set<NameId> robots;
  for (const auto& [session, member] : members_) {
    if (!member.owner.expired()) robots.insert(member.robot);
  }
  info.robots = static_cast<std::uint32_t>(robots.size());
  info.enabled_version = versions_.enabled();
  info.versions = versions_.infos();
  if (chosen_) {
    const auto enabled = std::ranges::find(info.versions, info.enabled_version, &MapVersionInfo::version);
    if (enabled != info.versions.end()) enabled->note += std::string(enabled->note.empty() ? "" : "; ") + kLeftAlone;
  }
  info.edits_version = edits_.version();
  if (const auto box = tiles.BoxOf(0)) {
    const double tile_m = kTileCells * resolution_m_;
    info.tile_count = static_cast<std::uint32_t>(box->count);
    info.x_min_m = box->x_min * tile_m;
    info.y_min_m = box->y_min * tile_m;
    info.x_max_m = (box->x_max + 1) * tile_m;
    info.y_max_m = (box->y_max + 1) * tile_m;
  }
  return info;
}

}  // namespace cairn::server
