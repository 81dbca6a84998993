#include "server/store/site_edit.h"

#include <algorithm>
#include <functional>
#include <set>
#include <utility>

namespace cairn::server {
namespace {

Result<void> CheckNewSite(Store& store, const std::string& name) {
  if (auto valid = ValidateName("site", name); !valid) return valid;
  const auto sites = store.Owners(RecordKind::kSite);
  if (!sites) return tl::unexpected(sites.error());
  if (std::find(sites->begin(), sites->end(), HashName(name)) == sites->end()) return {};
  return Fail(StatusCode::kAlreadyExists, "there is a site '" + name + "' already");
}

// Divides values by the session that they belong to: what `chosen` says goes into the result.
template <typename Values, typename Chosen>
Values TakeOut(Values& values, Chosen chosen) {
  Values taken;
  for (auto it = values.begin(); it != values.end();) {
    if (chosen(*it)) {
      taken.insert(values.extract(it++));
    } else {
      ++it;
    }
  }
  return taken;
}

bool Contains(const std::vector<std::uint64_t>& ids, std::uint64_t id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

// A site that is divided: the part that stays, and the part that goes.
struct Division {
  SiteContents contents;
  std::set<std::uint64_t> going;  // Sessions.
  std::set<std::string> robots;   // The robots of these sessions.
  std::vector<StoredVersion> staying_versions, going_versions;
  StoredSite going_site;
};

Result<Division> Divide(Store& store, SiteContents contents, const std::vector<std::uint64_t>& sessions) {
  Division division;
  division.contents = std::move(contents);
  division.going = {sessions.begin(), sessions.end()};
  for (const std::uint64_t id : division.going) {
    const auto session = division.contents.sessions.find(id);
    if (session != division.contents.sessions.end()) division.robots.insert(session->second.request.robot);
  }
  auto versions = ReadVersions(store, HashName(division.contents.site.name));
  if (!versions) return tl::unexpected(versions.error());
  for (auto& [number, version] : *versions) {
    StoredVersion gone{.version = number, .job = version.job, .note = version.note, .parts = {}, .smoothed = {}};
    gone.parts = TakeOut(version.parts, [&](const auto& part) { return division.going.contains(part.first); });
    gone.smoothed = TakeOut(version.smoothed, [&](const auto& path) {
      const std::uint64_t session = path.second.session;
      return session == 0 ? division.robots.contains(path.first) : division.going.contains(session);
    });
    division.staying_versions.push_back(std::move(version));
    division.going_versions.push_back(std::move(gone));
  }
  StoredSite& stays = division.contents.site;
  division.going_site = stays;
  division.going_site.members =
      TakeOut(stays.members, [&](const auto& member) { return division.going.contains(member.second); });
  division.going_site.fragments =
      TakeOut(stays.fragments, [&](std::uint64_t fragment) { return division.going.contains(fragment); });
  division.going_site.kept_apart =
      TakeOut(stays.kept_apart, [&](std::uint64_t fragment) { return division.going.contains(fragment); });
  division.going_site.merged =
      TakeOut(stays.merged, [&](std::uint64_t layer) { return division.going.contains(layer); });
  const auto goes = [&](std::uint64_t session) { return division.going.contains(session); };
  std::erase_if(stays.past, goes);
  std::erase_if(division.going_site.past, std::not_fn(goes));
  DropAnchors(stays, goes);
  DropAnchors(division.going_site, std::not_fn(goes));
  ++stays.tile_version;
  return division;
}

// NOT_FOUND: no such site or session.
Result<Division> DivideSite(Store& store, const std::string& site, const std::vector<std::uint64_t>& sessions) {
  auto contents = ReadSite(store, site);
  if (!contents) return tl::unexpected(contents.error());
  for (const std::uint64_t id : sessions) {
    if (!contents->sessions.contains(id) && !Contains(contents->layers, id))
      return Fail(StatusCode::kNotFound, "site '" + site + "' has no session " + std::to_string(id));
  }
  return Divide(store, std::move(*contents), sessions);
}

bool Names(const StoredSite& site, std::uint64_t session) {
  const auto& members = site.members;
  return Contains(site.past, session) || site.fragments.contains(session) || site.merged.contains(session) ||
         std::any_of(members.begin(), members.end(), [session](const auto& one) { return one.second == session; });
}

// Removes a session but for what is large, which RemoveRests does.
void RemoveSession(std::uint64_t session, RecordChanges& changes) {
  for (const RecordKind kind : {RecordKind::kSession, RecordKind::kRestoring, RecordKind::kRelations})
    changes.removed.push_back({.kind = kind, .owner = session});
  changes.put.push_back(MarkOfRemoved(session));
}

void PutStaying(const Division& division, RecordChanges& changes) {
  const NameId site = HashName(division.contents.site.name);
  changes.put.push_back({{RecordKind::kSite, site, 0}, BytesOf(division.contents.site)});
  for (const StoredVersion& version : division.staying_versions)
    changes.put.push_back({{RecordKind::kMapVersion, site, version.version}, BytesOf(version)});
  for (const std::uint64_t id : division.going)
    changes.removed.push_back({.kind = RecordKind::kLayer, .owner = site, .first = id, .last = id});
}

}  // namespace

Result<void> DeleteSite(Store& store, const std::string& site) {
  auto contents = ReadSite(store, site);
  if (!contents) {
    const bool missing = contents.error().code == StatusCode::kNotFound;
    const auto versions = store.Numbers({.kind = RecordKind::kMapVersion, .owner = HashName(site)});
    const auto layers = store.Numbers({.kind = RecordKind::kLayer, .owner = HashName(site)});
    // Where its own record is damaged or missing, the rest of it is deleted.
    if (!missing || !versions || !layers || !versions->empty() || !layers->empty()) contents = ReadAround(store, site);
  }
  if (!contents) return tl::unexpected(contents.error());
  RecordChanges changes;
  for (const RecordKind kind : {RecordKind::kSite, RecordKind::kMapVersion, RecordKind::kLayer})
    changes.removed.push_back({.kind = kind, .owner = HashName(site)});
  for (const auto& [id, job] : contents->jobs) changes.removed.push_back({.kind = RecordKind::kJob, .owner = id});
  for (const auto& [id, session] : contents->sessions) RemoveSession(id, changes);
  return store.Commit(changes);
}

Result<void> DeleteSession(Store& store, const std::string& site, std::uint64_t session) {
  const auto division = DivideSite(store, site, {session});
  if (!division) return tl::unexpected(division.error());
  RecordChanges changes;
  PutStaying(*division, changes);
  RemoveSession(session, changes);
  return store.Commit(changes);
}

Result<void> DeleteUnreadable(Store& store, std::uint64_t session) {
  const auto unreadable = UnreadableSessions(store);
  if (!unreadable) return tl::unexpected(unreadable.error());
  if (!Contains(*unreadable, session))
    return Fail(StatusCode::kNotFound, "there is no session " + std::to_string(session) + " that cannot be read");
  const auto names = SiteNames(store);
  if (!names) return tl::unexpected(names.error());
  RecordChanges changes;
  for (const std::string& name : *names) {
    auto contents = ReadSite(store, name);
    if (!contents) return tl::unexpected(contents.error());
    if (!Names(contents->site, session)) continue;
    const auto division = Divide(store, std::move(*contents), {session});
    if (!division) return tl::unexpected(division.error());
    PutStaying(*division, changes);
  }
  RemoveSession(session, changes);
  return store.Commit(changes);
}

Result<void> DeleteJob(Store& store, std::uint64_t job) {
  const auto jobs = store.Owners(RecordKind::kJob);
  if (!jobs) return tl::unexpected(jobs.error());
  if (!Contains(*jobs, job)) return Fail(StatusCode::kNotFound, "there is no job " + std::to_string(job));
  return store.Commit({.removed = {{.kind = RecordKind::kJob, .owner = job}}, .put = {}});
}

Result<void> SplitSite(Store& store, const std::string& site, const std::vector<std::uint64_t>& sessions,
                       const std::string& new_site) {
  if (auto fresh = CheckNewSite(store, new_site); !fresh) return fresh;
  auto division = DivideSite(store, site, sessions);
  if (!division) return tl::unexpected(division.error());
  RecordChanges changes;
  PutStaying(*division, changes);
  const NameId to = HashName(new_site);
  division->going_site.name = new_site;
  changes.put.push_back({{RecordKind::kSite, to, 0}, BytesOf(division->going_site)});
  for (const StoredVersion& version : division->going_versions)
    changes.put.push_back({{RecordKind::kMapVersion, to, version.version}, BytesOf(version)});
  const auto layers = ReadLayers(store, HashName(site));
  if (!layers) return tl::unexpected(layers.error());
  for (const StoredLayer& layer : *layers) {
    if (division->going.contains(layer.session))
      changes.put.push_back({{RecordKind::kLayer, to, layer.session}, BytesOf(layer)});
  }
  for (auto& [id, session] : division->contents.sessions) {
    if (!division->going.contains(id)) continue;
    session.request.site = new_site;
    changes.put.push_back({{RecordKind::kSession, id, 0}, BytesOf(session)});
  }
  return store.Commit(changes);
}

}  // namespace cairn::server
