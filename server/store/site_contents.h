// What a store holds of one site: the site itself, its map versions, the parts of its map whose sessions exist no more
// (layers), its jobs, and its sessions with their checkpoints and journals. Stateless, thread-safe.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "server/store/records.h"
#include "server/store/store.h"

namespace cairn::server {

struct SiteContents {
  StoredSite site;
  std::map<std::uint64_t, StoredSession> sessions;  // By id.
  std::vector<std::uint64_t> layers;                // Sessions that exist no more.
  std::map<std::uint64_t, StoredJob> jobs;          // By id.
};

// The names of all sites, sorted. Sites, sessions and jobs whose own record cannot be read are left out here, in
// ReadSite and in ReadSessions, because nothing says where they belong.
[[nodiscard]] Result<std::vector<std::string>> SiteNames(Store& store);
// NOT_FOUND: no such site. DATA_LOSS: a record is damaged.
[[nodiscard]] Result<SiteContents> ReadSite(Store& store, const std::string& name);
// As ReadSite, but of the site itself only the name: its own record may be damaged.
[[nodiscard]] Result<SiteContents> ReadAround(Store& store, const std::string& name);
// All sessions of all sites, by id.
[[nodiscard]] Result<std::map<std::uint64_t, StoredSession>> ReadSessions(Store& store);
// The name of a site whose own record cannot be read, as its sessions say; empty if none of them does.
[[nodiscard]] std::string NameOfSite(Store& store, NameId site);
// Sessions without a record of their own of which a journal or a complete checkpoint is there, in ascending order.
// Removed ones do not count.
[[nodiscard]] Result<std::vector<std::uint64_t>> SessionsWithoutRecord(Store& store);
// These, and the sessions whose own record is damaged, in ascending order: which site they belong to is not known.
[[nodiscard]] Result<std::vector<std::uint64_t>> UnreadableSessions(Store& store);
// The highest number that a session has or had; 0: there was none. Records that cannot be read count.
[[nodiscard]] Result<std::uint64_t> LastSession(Store& store);
// A session's own record is removed first, in one commit with a mark of it, because the rest, its checkpoints and its
// journal, can be large. That is removed piece by piece (Store::RemoveFirst), in this order, and the mark last.
[[nodiscard]] Record MarkOfRemoved(std::uint64_t session);
[[nodiscard]] std::vector<RecordRange> RangesOfRemoved(std::uint64_t session);
// Removes what is left of all sessions with a mark.
[[nodiscard]] Result<void> RemoveRests(Store& store);
[[nodiscard]] Result<std::map<std::uint32_t, StoredVersion>> ReadVersions(Store& store, NameId site);
[[nodiscard]] Result<std::vector<StoredLayer>> ReadLayers(Store& store, NameId site);

// Every record of the site, the site itself first; every record of one session, the session itself first.
[[nodiscard]] std::vector<RecordRange> RangesOf(const SiteContents& contents);
[[nodiscard]] std::vector<RecordRange> RangesOfSession(std::uint64_t session);

// The session of the robot of this name, else the session of this number; sessions that exist no more have only a
// number. NOT_FOUND: the site has no such session.
[[nodiscard]] Result<std::uint64_t> FindSession(const SiteContents& contents, const std::string& robot_or_number);

// Takes away the keyframes of the sessions for which `goes` is true. An edit goes on from where it lies with those that
// are left. An edit without any is anchored anew where robots draw the map.
void DropAnchors(StoredSite& site, const std::function<bool(std::uint64_t session)>& goes);

}  // namespace cairn::server
