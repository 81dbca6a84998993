#include "server/store/site_contents.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "server/store/checkpoint_writer.h"

namespace cairn::server {
namespace {

// Calls `take` with every record of this kind and owner, as a value.
template <typename Of, typename Take>
Result<void> ForEach(Store& store, RecordKind kind, std::uint64_t owner, Of of, Take take) {
  return store.Read({.kind = kind, .owner = owner}, [&](std::uint64_t, std::string_view bytes) -> Result<void> {
    auto value = of(bytes);
    if (!value) return tl::unexpected(value.error());
    take(std::move(*value));
    return {};
  });
}

// All values of the kind, by owner.
template <typename Value, typename Of>
Result<std::map<std::uint64_t, Value>> ReadAll(Store& store, RecordKind kind, Of of) {
  const auto owners = store.Owners(kind);
  if (!owners) return tl::unexpected(owners.error());
  std::map<std::uint64_t, Value> all;
  for (const std::uint64_t owner : *owners) {
    const auto keep = [&all, owner](Value&& value) { all.insert_or_assign(owner, std::move(value)); };
    const auto read = ForEach(store, kind, owner, of, keep);
    // A record that nobody can read must not keep others from being used.
    const bool unreadable =
        !read && (read.error().code == StatusCode::kDataLoss || read.error().code == StatusCode::kFailedPrecondition);
    if (!read && !unreadable) return tl::unexpected(read.error());
  }
  return all;
}

// Of a session that could not be stored, a checkpoint may have been begun.
bool IsComplete(const Result<std::optional<StoredCheckpoint>>& checkpoint) {
  return !checkpoint || *checkpoint;
}

}  // namespace

Result<std::vector<std::string>> SiteNames(Store& store) {
  const auto sites = ReadAll<StoredSite>(store, RecordKind::kSite, SiteOf);
  if (!sites) return tl::unexpected(sites.error());
  std::vector<std::string> names;
  for (const auto& [owner, site] : *sites) names.push_back(site.name);
  std::sort(names.begin(), names.end());
  return names;
}

Result<std::map<std::uint64_t, StoredSession>> ReadSessions(Store& store) {
  return ReadAll<StoredSession>(store, RecordKind::kSession, SessionOf);
}

std::vector<RecordRange> RangesOfRemoved(std::uint64_t session) {
  return {{.kind = RecordKind::kCheckpoint, .owner = session},
          {.kind = RecordKind::kJournal, .owner = session},
          {.kind = RecordKind::kRemoved, .owner = session}};
}

Record MarkOfRemoved(std::uint64_t session) {
  return {{RecordKind::kRemoved, session, 0}, "removed"};
}

Result<void> RemoveRests(Store& store) {
  const auto removed = store.Owners(RecordKind::kRemoved);
  if (!removed) return tl::unexpected(removed.error());
  for (const std::uint64_t session : *removed) {
    for (const RecordRange& range : RangesOfRemoved(session)) {
      const std::size_t piece = RemovedAtOnce(range.kind);
      for (std::size_t count = piece; count == piece;) {
        const auto first = store.RemoveFirst(range, piece);
        if (!first) return tl::unexpected(first.error());
        count = *first;
      }
    }
  }
  return {};
}

std::string NameOfSite(Store& store, NameId site) {
  const auto sessions = ReadSessions(store);
  if (!sessions) return {};
  for (const auto& [id, session] : *sessions)
    if (HashName(session.request.site) == site) return session.request.site;
  return {};
}

Result<std::vector<std::uint64_t>> SessionsWithoutRecord(Store& store) {
  std::set<std::uint64_t> known, others;
  for (const RecordKind kind :
       {RecordKind::kSession, RecordKind::kRemoved, RecordKind::kJournal, RecordKind::kCheckpoint}) {
    const bool names = kind == RecordKind::kSession || kind == RecordKind::kRemoved;
    const auto owners = store.Owners(kind);
    if (!owners) return tl::unexpected(owners.error());
    for (const std::uint64_t session : *owners) {
      if (names || known.contains(session)) {
        known.insert(session);
      } else if (kind == RecordKind::kJournal || IsComplete(ReadCheckpoint(store, session))) {
        others.insert(session);
      }
    }
  }
  return std::vector<std::uint64_t>(others.begin(), others.end());
}

Result<std::vector<std::uint64_t>> UnreadableSessions(Store& store) {
  auto unreadable = SessionsWithoutRecord(store);
  if (!unreadable) return unreadable;
  const auto recorded = store.Owners(RecordKind::kSession);
  if (!recorded) return tl::unexpected(recorded.error());
  const auto read = ReadSessions(store);
  if (!read) return tl::unexpected(read.error());
  std::copy_if(recorded->begin(), recorded->end(), std::back_inserter(*unreadable),
               [&read](std::uint64_t id) { return !read->contains(id); });
  std::sort(unreadable->begin(), unreadable->end());
  return unreadable;
}

Result<std::uint64_t> LastSession(Store& store) {
  std::uint64_t last = 0;
  // One that was removed, or of which the own record is missing, counts as long as something is left of it.
  for (const RecordKind kind :
       {RecordKind::kSession, RecordKind::kRemoved, RecordKind::kJournal, RecordKind::kCheckpoint}) {
    const auto owners = store.Owners(kind);
    if (!owners) return tl::unexpected(owners.error());
    if (!owners->empty()) last = std::max(last, owners->back());
  }
  // A session that was never stored itself may be named by its site.
  const auto named = ReadAll<StoredSite>(store, RecordKind::kSite, SiteOf);
  if (!named && named.error().code != StatusCode::kDataLoss) return tl::unexpected(named.error());
  if (named) {
    for (const auto& [owner, site] : *named) {
      for (const auto& [robot, session] : site.members) last = std::max(last, session);
      for (const std::uint64_t session : site.past) last = std::max(last, session);
      for (const std::uint64_t session : site.fragments) last = std::max(last, session);
    }
  }
  const auto sites = store.Owners(RecordKind::kLayer);
  if (!sites) return tl::unexpected(sites.error());
  for (const std::uint64_t site : *sites) {
    const auto layers = store.Numbers({.kind = RecordKind::kLayer, .owner = site});
    if (!layers) return tl::unexpected(layers.error());
    if (!layers->empty()) last = std::max(last, layers->back());
  }
  return last;
}

Result<std::map<std::uint32_t, StoredVersion>> ReadVersions(Store& store, NameId site) {
  std::map<std::uint32_t, StoredVersion> versions;
  const auto keep = [&versions](StoredVersion&& version) {
    const std::uint32_t number = version.version;
    versions.insert_or_assign(number, std::move(version));
  };
  if (auto read = ForEach(store, RecordKind::kMapVersion, site, VersionOf, keep); !read)
    return tl::unexpected(read.error());
  return versions;
}

Result<std::vector<StoredLayer>> ReadLayers(Store& store, NameId site) {
  std::vector<StoredLayer> layers;
  const auto keep = [&layers](StoredLayer&& layer) { layers.push_back(std::move(layer)); };
  if (auto read = ForEach(store, RecordKind::kLayer, site, LayerOf, keep); !read) return tl::unexpected(read.error());
  return layers;
}

Result<SiteContents> ReadSite(Store& store, const std::string& name) {
  StoredSite site;
  const auto keep = [&site](StoredSite&& read) { site = std::move(read); };
  if (auto read = ForEach(store, RecordKind::kSite, HashName(name), SiteOf, keep); !read)
    return tl::unexpected(read.error());
  if (site.name != name) return Fail(StatusCode::kNotFound, "there is no site '" + name + "'");
  auto contents = ReadAround(store, name);
  if (contents) contents->site = std::move(site);
  return contents;
}

Result<SiteContents> ReadAround(Store& store, const std::string& name) {
  SiteContents contents;
  contents.site.name = name;
  auto layers = store.Numbers({.kind = RecordKind::kLayer, .owner = HashName(name)});
  if (!layers) return tl::unexpected(layers.error());
  contents.layers = std::move(*layers);
  auto sessions = ReadSessions(store);
  if (!sessions) return tl::unexpected(sessions.error());
  std::erase_if(*sessions, [&name](const auto& one) { return one.second.request.site != name; });
  contents.sessions = std::move(*sessions);
  auto jobs = ReadAll<StoredJob>(store, RecordKind::kJob, JobOf);
  if (!jobs) return tl::unexpected(jobs.error());
  std::erase_if(*jobs, [&name](const auto& one) { return one.second.job.site != name; });
  contents.jobs = std::move(*jobs);
  return contents;
}

std::vector<RecordRange> RangesOfSession(std::uint64_t session) {
  return {{.kind = RecordKind::kSession, .owner = session},
          {.kind = RecordKind::kCheckpoint, .owner = session},
          {.kind = RecordKind::kJournal, .owner = session},
          {.kind = RecordKind::kRestoring, .owner = session},
          {.kind = RecordKind::kRelations, .owner = session}};
}

std::vector<RecordRange> RangesOf(const SiteContents& contents) {
  std::vector<RecordRange> ranges;
  for (const RecordKind kind : {RecordKind::kSite, RecordKind::kMapVersion, RecordKind::kLayer})
    ranges.push_back({.kind = kind, .owner = HashName(contents.site.name)});
  for (const auto& [id, job] : contents.jobs) ranges.push_back({.kind = RecordKind::kJob, .owner = id});
  for (const auto& [id, session] : contents.sessions) {
    for (const RecordRange& range : RangesOfSession(id)) ranges.push_back(range);
  }
  return ranges;
}

Result<std::uint64_t> FindSession(const SiteContents& contents, const std::string& robot_or_number) {
  // Of several sessions of a robot it is the last one.
  for (auto it = contents.sessions.rbegin(); it != contents.sessions.rend(); ++it) {
    if (it->second.request.robot == robot_or_number) return it->first;
  }
  std::uint64_t number = 0;
  const char* const end = robot_or_number.data() + robot_or_number.size();
  const auto [stopped, error] = std::from_chars(robot_or_number.data(), end, number);
  const bool known = contents.sessions.contains(number) ||
                     std::find(contents.layers.begin(), contents.layers.end(), number) != contents.layers.end();
  if (error == std::errc() && stopped == end && known) return number;
  return Fail(StatusCode::kNotFound, "site '" + contents.site.name + "' has no session of '" + robot_or_number + "'");
}

void DropAnchors(StoredSite& site, const std::function<bool(std::uint64_t session)>& goes) {
  for (const MapEdit& edit : site.edits) {
    const auto found = site.anchors.find(edit.id);
    if (found == site.anchors.end()) continue;
    EditAnchors& anchors = found->second;
    if (std::erase_if(anchors.keyframes, [&goes](const EditAnchor& one) { return goes(one.session); }) == 0) continue;
    anchors.points_then = edit.points_map;
    for (EditAnchor& one : anchors.keyframes) one.T_map_then = one.T_map_now;
  }
}

}  // namespace cairn::server
