// How two sites of a store become one (site_edit.h).
#include <algorithm>
#include <limits>
#include <utility>

#include "common/map/building_frame.h"
#include "common/service/start_pose.h"
#include "server/store/checkpoint_writer.h"
#include "server/store/grid_transform.h"
#include "server/store/site_edit.h"

namespace cairn::server {
namespace {

using Versions = std::map<std::uint32_t, StoredVersion>;

// The paths that a site shows: those of the enabled version; if it has none, of the newest version that has some.
SmoothedPaths Shown(const Versions& versions, std::uint32_t enabled) {
  const auto found = versions.find(enabled);
  if (found != versions.end() && !found->second.smoothed.empty()) return found->second.smoothed;
  for (auto it = versions.rbegin(); it != versions.rend(); ++it) {
    if (!it->second.smoothed.empty()) return it->second.smoothed;
  }
  return {};
}

// The epoch of a switch that was not completed: higher than any that there is, because those that are lower than the
// ones a site knows count as completed.
constexpr std::uint32_t kNever = std::numeric_limits<std::uint32_t>::max();

tl::unexpected<Status> CannotBeMoved(std::uint64_t session, const std::string& why) {
  return Fail(StatusCode::kFailedPrecondition,
              "session " + std::to_string(session) + " cannot be moved: " + why +
                  ". Merge the sites the other way round, so that the other one is moved, or remove the session before "
                  "(cairn site delete-session)");
}

class Merge {
 public:
  Merge(Store& store, SiteContents into, SiteContents from, const Pose2& T_into_from)
      : store_(store),
        into_(std::move(into)),
        from_(std::move(from)),
        T_into_from_(T_into_from),
        moves_(!(T_into_from == Pose2{})),
        epoch_shift_(into_.site.epoch) {}

  Result<RecordChanges> Changes() {
    for (auto step : {&Merge::Check, &Merge::Sessions, &Merge::Layers, &Merge::MapVersions}) {
      if (auto done = (this->*step)(); !done) return tl::unexpected(done.error());
    }
    for (auto& [id, stored] : from_.jobs) {
      stored.job.site = into_.site.name;
      if (stored.job.map_version > 1) stored.job.map_version += version_shift_;
      for (PoseHypothesis& place : stored.job.places) place.T_map_robot = T_into_from_ * place.T_map_robot;
      Put({RecordKind::kJob, id, 0}, BytesOf(stored));
    }
    if (auto merged = Site(); !merged) return tl::unexpected(merged.error());
    return std::move(changes_);
  }

 private:
  void Put(const RecordKey& key, std::string bytes) { changes_.put.push_back({key, std::move(bytes)}); }

  Result<void> Check() {
    const double into_m = into_.site.resolution_m, from_m = from_.site.resolution_m;
    if (into_m != from_m) {
      return Fail(StatusCode::kFailedPrecondition,
                  "the sites have cells of different sizes: " + std::to_string(into_m) + " m and " +
                      std::to_string(from_m) + " m");
    }
    if (!moves_) return {};
    if (auto valid = ValidateStart(T_into_from_); !valid) return valid;
    if (from_m == 0.0) {
      return Fail(StatusCode::kFailedPrecondition,
                  "site '" + from_.site.name + "' does not say the size of its cells, which a transform needs");
    }
    return {};
  }

  // Corrections name epochs, and a switch that was not completed may not look completed among those of both sites.
  Result<void> Journals(const SiteContents& of, std::uint32_t shift, bool moves) {
    for (const auto& [id, session] : of.sessions) {
      std::uint64_t first = 0, next = 1;
      bool whole = true, place_waits = false;
      const auto take = [&, id = id](std::uint64_t number, std::string_view bytes) -> Result<void> {
        auto batch = BatchOf(bytes);
        if (!batch) return tl::unexpected(batch.error());
        if (first == 0) first = batch->first;
        whole = whole && batch->first == next;
        next = batch->first + batch->entries.size();
        bool changed = false;
        for (JournalEntry& entry : batch->entries) {
          if (auto* const epoch = std::get_if<EpochChanged>(&entry)) {
            changed = true;
            epoch->epoch += shift;
          }
          auto* const relocalise = std::get_if<RelocaliseTaken>(&entry);
          if (relocalise != nullptr && relocalise->T_map_robot && moves) {
            changed = true;
            relocalise->T_map_robot = T_into_from_ * *relocalise->T_map_robot;
          }
          const auto* const localise = std::get_if<LocaliseTaken>(&entry);
          auto* const suggested = std::get_if<PlaceSuggested>(&entry);
          if (suggested != nullptr && !suggested->map.tiles.empty() && moves) {
            // The map around the place is one of the site before. A place that no scan has confirmed is given up, and
            // the robot is looked for again.
            changed = place_waits = true;
            suggested->map.tiles.clear();
          }
          if (place_waits && std::holds_alternative<ScanTaken>(entry))
            return CannotBeMoved(id,
                                 "a job has found its robot in the map of its site, which scans may have confirmed");
          if (localise != nullptr && !localise->maps_again && moves)
            return CannotBeMoved(id, "its robot was only localised in the map of its site");
          auto* const correction = std::get_if<CorrectionTaken>(&entry);
          if (correction == nullptr) continue;
          changed = true;
          const bool completed = IsCompleted(of.site.switches, correction->epoch, correction->generation);
          correction->epoch = completed ? correction->epoch + shift : kNever;
          // Its site may have forgotten the switch, as it does with the oldest. The merged one has to know it.
          if (completed)
            correction->generation = completed_.emplace(correction->epoch, correction->generation).first->second;
          if (moves && !correction->grid.fragment)
            correction->grid = Transformed(correction->grid, T_into_from_, of.site.resolution_m);
        }
        if (changed) Put({RecordKind::kJournal, id, number}, BytesOf(batch->first, batch->entries));
        return {};
      };
      if (auto read = store_.Read({.kind = RecordKind::kJournal, .owner = id}, take); !read) return read;
      // A checkpoint cannot be moved: the session will be restored from its journal alone.
      if (moves && first == 0) {
        const auto checkpoint = ReadCheckpoint(store_, id);
        whole = checkpoint && !*checkpoint;
      }
      if (moves && !whole) {
        return CannotBeMoved(
            id, (first == 0 ? "its journal has no entries" : "its journal begins at entry " + std::to_string(first)) +
                    ", because older ones were removed (store.max_gib)");
      }
    }
    return {};
  }

  Result<void> Sessions() {
    if (auto rewritten = Journals(into_, 0, false); !rewritten) return rewritten;
    if (auto rewritten = Journals(from_, epoch_shift_, moves_); !rewritten) return rewritten;
    for (auto& [id, session] : from_.sessions) {
      session.request.site = into_.site.name;
      session.map_epoch += epoch_shift_;
      if (moves_) {
        if (!session.fragment) {  // The place of a fragment in the map is not known, neither before nor after.
          Pose2& start = session.request.T_map_robot_start;
          start = session.request.has_start ? T_into_from_ * start : T_into_from_;
          session.request.has_start = true;
          if (auto valid = ValidateStart(start); !valid) return valid;
        }
        changes_.removed.push_back({.kind = RecordKind::kCheckpoint, .owner = id});
      }
      Put({RecordKind::kSession, id, 0}, BytesOf(session));
    }
    return {};
  }

  StoredGrid Moved(const StoredGrid& grid) const {
    return moves_ && !grid.fragment ? Transformed(grid, T_into_from_, from_.site.resolution_m) : grid;
  }

  [[nodiscard]] EditAnchors Moved(EditAnchors anchors) const {
    for (Eigen::Vector2d& point : anchors.points_then) point = T_into_from_ * point;
    for (EditAnchor& one : anchors.keyframes) {
      one.T_map_then = T_into_from_ * one.T_map_then;
      one.T_map_now = T_into_from_ * one.T_map_now;
    }
    return anchors;
  }

  Result<void> Layers() {
    auto layers = ReadLayers(store_, HashName(from_.site.name));
    if (!layers) return tl::unexpected(layers.error());
    for (StoredLayer& layer : *layers) {
      layer.grid.fragment = from_.site.fragments.contains(layer.session);
      Put({RecordKind::kLayer, HashName(into_.site.name), layer.session},
          BytesOf(StoredLayer{layer.session, Moved(layer.grid)}));
    }
    return {};
  }

  // The versions of `into` keep their numbers, those of `from` follow. Version 1, the live map, is one of both. A new
  // version is enabled, because what the sessions draw now is neither of those that were.
  Result<void> MapVersions() {
    auto into = ReadVersions(store_, HashName(into_.site.name));
    if (!into) return tl::unexpected(into.error());
    auto from = ReadVersions(store_, HashName(from_.site.name));
    if (!from) return tl::unexpected(from.error());
    version_shift_ = into_.site.next_version - 2;
    SmoothedPaths shown = Shown(*into, into_.site.enabled_version);
    Versions merged = std::move(*into);
    const auto Path = [this](const SmoothedPath& path) {
      return moves_ ? SmoothedPath{path.session, Transformed(*path.path, T_into_from_)} : path;
    };
    for (const auto& [robot, path] : Shown(*from, from_.site.enabled_version)) shown.emplace(robot, Path(path));
    for (auto& [number, version] : *from) {
      const std::uint32_t renumbered = number == 1 ? 1 : number + version_shift_;
      StoredVersion& to = merged[renumbered];
      if (to.version == 0)
        to = {.version = renumbered, .job = version.job, .note = version.note, .parts = {}, .smoothed = {}};
      for (const auto& [session, grid] : version.parts) to.parts.emplace(session, Moved(grid));
      for (const auto& [robot, path] : version.smoothed) to.smoothed.emplace(robot, Path(path));
    }
    const std::uint32_t both = from_.site.next_version + version_shift_;
    merged[both] = {.version = both,
                    .job = 0,
                    .note = "merged: " + into_.site.name + " and " + from_.site.name,
                    .parts = {},
                    .smoothed = std::move(shown)};
    for (const auto& [number, version] : merged)
      Put({RecordKind::kMapVersion, HashName(into_.site.name), number}, BytesOf(version));
    into_.site.enabled_version = both;
    into_.site.next_version = both + 1;
    return {};
  }

  Result<void> Site() {
    StoredSite& site = into_.site;
    site.epoch += from_.site.epoch;
    site.tile_version = std::max(site.tile_version, from_.site.tile_version) + 1;
    for (const auto& [epoch, generation] : from_.site.switches) site.switches[epoch + epoch_shift_] = generation;
    site.switches.insert(completed_.begin(), completed_.end());
    site.members.insert(from_.site.members.begin(), from_.site.members.end());
    site.fragments.insert(from_.site.fragments.begin(), from_.site.fragments.end());
    site.kept_apart.insert(from_.site.kept_apart.begin(), from_.site.kept_apart.end());
    site.past.insert(site.past.end(), from_.site.past.begin(), from_.site.past.end());
    site.merged.insert(from_.site.merged.begin(), from_.site.merged.end());
    if (auto added = AddEdits(); !added) return added;
    Put({RecordKind::kSite, HashName(site.name), 0}, BytesOf(site));
    for (const RecordKind kind : {RecordKind::kSite, RecordKind::kMapVersion, RecordKind::kLayer})
      changes_.removed.push_back({.kind = kind, .owner = HashName(from_.site.name)});
    return {};
  }

  // A site that was split has left its edits in both parts: one of two that are the same is enough. The frame of the
  // building is that of `into`, if it has one.
  Result<void> AddEdits() {
    StoredSite& site = into_.site;
    const std::size_t own = site.edits.size();
    const bool has_frame = BuildingFrameOf(site.edits).has_value();
    for (const MapEdit& edit : from_.site.edits) {
      if (has_frame && edit.kind == MapEditKind::kOrigin) continue;
      MapEdit moved = cairn::Moved(edit, T_into_from_);
      if (auto valid = ValidateMapEdit(moved); !valid) return valid;
      const auto is_same = [&moved](MapEdit other) {
        other.id = moved.id;
        return other == moved;
      };
      if (std::any_of(site.edits.begin(), site.edits.begin() + static_cast<std::ptrdiff_t>(own), is_same)) continue;
      const auto anchors = from_.site.anchors.find(edit.id);
      moved.id += site.edits_version;
      if (anchors != from_.site.anchors.end()) site.anchors.emplace(moved.id, Moved(anchors->second));
      site.edits.push_back(std::move(moved));
    }
    site.edits_version += from_.site.edits_version;
    // A record with more could not be read again.
    if (site.edits.size() > kMostStoredEdits || site.edits_version >= kMaxEditsVersion - site.edits.size())
      return Fail(StatusCode::kOutOfRange, "the two sites have too many edits of their maps");
    return {};
  }

  Store& store_;
  SiteContents into_;
  SiteContents from_;
  const Pose2 T_into_from_;
  const bool moves_;
  const std::uint32_t epoch_shift_;
  std::uint32_t version_shift_ = 0;
  Switches completed_;  // Those that corrections name, by their epochs in the merged site.
  RecordChanges changes_;
};

}  // namespace

Result<void> MergeSites(Store& store, const std::string& into, const std::string& from, const Pose2& T_into_from) {
  if (into == from) return Fail(StatusCode::kInvalidArgument, "a site cannot be merged with itself");
  auto first = ReadSite(store, into);
  if (!first) return tl::unexpected(first.error());
  auto second = ReadSite(store, from);
  if (!second) return tl::unexpected(second.error());
  const auto changes = Merge(store, std::move(*first), std::move(*second), T_into_from).Changes();
  if (!changes) return tl::unexpected(changes.error());
  return store.Commit(*changes);
}

}  // namespace cairn::server
