// What a site stores, and how it is restored (site.h).
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "server/maps/site.h"
#include "server/maps/stored_grid.h"

namespace cairn::server {
namespace {

StoredVersion StoredOf(const MapVersion& version) {
  StoredVersion stored{.version = version.info.version,
                       .job = version.info.job,
                       .note = version.info.note,
                       .parts = {},
                       .smoothed = version.smoothed};
  for (const auto& [session, part] : version.parts) stored.parts[session] = ToStored(part);
  return stored;
}

MapVersion VersionFrom(StoredVersion&& stored) {
  MapVersion version;
  version.info = {.version = stored.version, .enabled = false, .job = stored.job, .note = std::move(stored.note)};
  for (const auto& [session, grid] : stored.parts) version.parts[session] = FromStored(grid);
  version.smoothed = std::move(stored.smoothed);
  return version;
}

}  // namespace

void Site::Put(const RecordKey& key, Journal::Bytes bytes) {
  if (together_) {
    together_->put.emplace_back(key, std::move(bytes));
  } else if (journal_ != nullptr) {
    journal_->Put(key, std::move(bytes));
  }
}

void Site::RemoveRecords(const RecordRange& range) {
  if (together_) {
    std::erase_if(together_->put, [&range](const auto& one) {
      const RecordKey& key = one.first;
      return key.kind == range.kind && key.owner == range.owner && key.number >= range.first &&
             key.number <= range.last;
    });
    together_->removed.push_back(range);
  } else if (journal_ != nullptr) {
    journal_->Remove(range);
  }
}

SessionId Site::LastSession() const {
  return versions_.LastSession();
}

void Site::StoreEverything() {
  for (const std::uint32_t number : std::set<std::uint32_t>(stored_versions_)) StoreVersion(number);
  for (const SessionId session : layers_) StoreLayer(session);
  StoreSite();
}

void Site::StoreSite() {
  if (journal_ == nullptr) return;
  StoredSite stored{.name = name_,
                    .epoch = epoch_,
                    .tile_version = tile_version_,
                    .next_version = versions_.next(),
                    .enabled_version = versions_.enabled(),
                    .switches = switches_,
                    .members = {},
                    .resolution_m = resolution_m_,
                    .fragments = joint_.hidden(),
                    .past = joint_.past(),
                    .merged = merged_,
                    .map_frame = map_frame_,
                    .edits = *edits_.all(),
                    .edits_version = edits_.version(),
                    .anchors = edits_.anchors(),
                    .given_up = memory_.given_up(),
                    .chosen = chosen_,
                    .kept_apart = kept_apart()};
  for (const auto& [session, member] : members_) stored.members[member.robot] = session;  // The last one.
  Put({RecordKind::kSite, site_id_, 0}, [stored = std::move(stored)] { return BytesOf(stored); });
}

void Site::StoreVersion(std::uint32_t number) {
  const MapVersion* const version = versions_.Find(number);
  if (journal_ == nullptr || version == nullptr) return;
  stored_versions_.insert(number);
  Put({RecordKind::kMapVersion, site_id_, number}, [stored = StoredOf(*version)] { return BytesOf(stored); });
}

void Site::RemoveOldVersions() {
  if (journal_ == nullptr) return;
  std::erase_if(stored_versions_, [this](std::uint32_t number) {
    if (versions_.Find(number) != nullptr) return false;
    RemoveRecords({.kind = RecordKind::kMapVersion, .owner = site_id_, .first = number, .last = number});
    return true;
  });
}

bool Site::Switched(std::uint32_t epoch, Generation generation) const {
  return IsCompleted(switches_, epoch, generation);
}

Result<void> Site::Restore(const StoredSite& stored, StartControl& control) {
  if (stored.resolution_m != 0.0 && stored.resolution_m != resolution_m_) {
    return Fail(StatusCode::kFailedPrecondition, "site '" + name_ + "' is stored with cells of " +
                                                     std::to_string(stored.resolution_m) +
                                                     " m; slam.grid.resolution_m is " + std::to_string(resolution_m_));
  }
  epoch_ = std::max(epoch_, stored.epoch);
  tile_version_ = std::max(tile_version_, stored.tile_version);
  switches_ = stored.switches;
  // One that was stored without a number has a new one. It is stored with the first session, before which no robot
  // learns it.
  if (stored.map_frame != 0) map_frame_ = stored.map_frame;
  for (const SessionId session : stored.fragments) joint_.SetHidden(session, true);
  for (const SessionId session : stored.past) joint_.SetPast(session);
  merged_ = stored.merged;
  memory_.Restore(stored.given_up);
  chosen_ = stored.chosen;
  {
    const MutexLock lock(mutex_);
    kept_apart_ = stored.kept_apart;
  }
  const std::size_t left_out = edits_.Restore(
      stored.edits, stored.edits_version, [&control] { control.Advance(); }, stored.anchors);
  if (left_out > 0) spdlog::error("site {}: {} edits of its map cover too much and are left out", name_, left_out);
  joint_.SetEdits(edits_.overlay());
  for (const auto& [robot, session] : stored.members) stored_members_.insert(session);
  if (auto restored = RestoreVersions(stored, control); !restored) return restored;
  if (auto restored = RestoreLayers(control); !restored) return restored;
  if (control.given_up()) return Fail(StatusCode::kCancelled, "the start was given up");
  Render();
  control.Advance();
  return {};
}

void Site::PutAside(const std::string& what, const Status& why) {
  LosePart();
  spdlog::error("{}", journal_->set_aside().Add(name_, what + " of site '" + name_ + "'", why));
}

Result<void> Site::RestoreVersions(const StoredSite& stored, StartControl& control) {
  std::map<std::uint32_t, MapVersion> versions;
  const auto add_live = [&versions] { versions[1].info = {.version = 1, .enabled = false, .job = 0, .note = "live"}; };
  // Without a record it is the map that robots draw, or was given up.
  if (stored.given_up.versions == 0 || stored.enabled_version == 1) add_live();
  std::uint32_t next = stored.next_version;
  const auto take = [&versions, &control](std::uint64_t number, std::string_view bytes) -> Result<void> {
    control.Advance();
    auto version = VersionOf(bytes);
    if (!version) return tl::unexpected(version.error());
    if (version->version != number) return Fail(StatusCode::kDataLoss, "the record is that of another version");
    versions[version->version] = VersionFrom(std::move(*version));
    return {};
  };
  const auto unreadable = [&](std::uint64_t number, const Status& why) {
    PutAside("map version " + std::to_string(number), why);
    // No later version may be written over it.
    if (number < UINT32_MAX) next = std::max(next, static_cast<std::uint32_t>(number) + 1);
  };
  const RecordRange all{.kind = RecordKind::kMapVersion, .owner = site_id_};
  if (auto read = ReadEach(journal_->store(), all, take, unreadable); !read) return read;
  if (versions.empty()) add_live();
  for (const auto& [number, version] : versions) stored_versions_.insert(number);
  const std::uint32_t newest = versions.rbegin()->first;
  const std::uint32_t enabled = versions.contains(stored.enabled_version) ? stored.enabled_version : newest;
  if (enabled != stored.enabled_version) {
    PutAside("the enabled map version " + std::to_string(stored.enabled_version),
             {StatusCode::kDataLoss, "it cannot be read; version " + std::to_string(enabled) + " is enabled instead"});
  }
  if (newest < UINT32_MAX) next = std::max(next, newest + 1);
  versions_.Restore(std::move(versions), next, enabled);
  return {};
}

}  // namespace cairn::server
