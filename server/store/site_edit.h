// Changes to the sites of a store: import, merge, split and delete. Each is one commit, so that after any end of the
// process the change is complete or absent; what is left of deleted sessions is for RemoveRests. For a store that
// nobody else uses: of a stopped server, or between two commits of a running one (Journal::Between, which removes
// that). Stateless.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "server/store/site_file.h"

namespace cairn::server {

struct ImportOptions {
  std::string site;                           // The name that the site gets; empty: as in the file.
  std::map<std::string, std::string> robots;  // New names of robots; the others keep theirs.
  // Numbers of sessions and jobs that the store must not use yet: they are given from there on. The store's own are
  // taken into account in any case.
  std::uint64_t first_session = 1;
  std::uint64_t first_job = 1;
  MayGoOn may_go_on = {};
};

// Adds the site of a file. Its sessions and jobs get new numbers in the old order, without gaps, after the store's own.
// The summary names site, robots and numbers as they are in the store now. ALREADY_EXISTS: the store has a site of this
// name, or one of the robots has a session in another site; a robot is in one site. INVALID_ARGUMENT: a new name that
// is none, or of a robot that is not there. Errors of the file: SiteFileReader.
[[nodiscard]] Result<SiteFileSummary> ImportSite(Store& store, const std::filesystem::path& file,
                                                 const ImportOptions& options = {});

// Also of a site with damaged records. NOT_FOUND: no such site.
[[nodiscard]] Result<void> DeleteSite(Store& store, const std::string& site);

// Moves everything of the site `from` into the site `into`. Where the transform is not the identity, each session of
// `from` begins at its transformed start and is estimated again from its journal at the next start of the server; grids
// of jobs and of sessions that exist no more are transformed cell by cell. The map versions of both are kept, and a new
// one is enabled that shows what is enabled in both. Edits by people stay where they are in the building, those of
// `from` over those of `into`; but the building's frame is that of `into`, if it has one. NOT_FOUND.
// FAILED_PRECONDITION: the sites have cells of different sizes; or a journal does not reach back to its beginning, so
// that the session cannot be estimated again.
[[nodiscard]] Result<void> MergeSites(Store& store, const std::string& into, const std::string& from,
                                      const Pose2& T_into_from = {});

// Moves the sessions (by number) with their parts of the map and of its versions into a new site. Jobs stay where they
// ran; edits by people are in both sites then, because they say something of the building. NOT_FOUND: no such site or
// session. ALREADY_EXISTS: there is a site of the new name.
[[nodiscard]] Result<void> SplitSite(Store& store, const std::string& site, const std::vector<std::uint64_t>& sessions,
                                     const std::string& new_site);

// Removes a session with its scans and its part of the map and of its versions. NOT_FOUND: no such site or session.
[[nodiscard]] Result<void> DeleteSession(Store& store, const std::string& site, std::uint64_t session);

// Removes a session that cannot be read (UnreadableSessions), and what sites say of it. NOT_FOUND: there is none of
// this number. DATA_LOSS: a map version of a site that names it cannot be read, either; then that site is to be deleted
// first.
[[nodiscard]] Result<void> DeleteUnreadable(Store& store, std::uint64_t session);

// Also one that cannot be read. NOT_FOUND: no such job.
[[nodiscard]] Result<void> DeleteJob(Store& store, std::uint64_t job);

}  // namespace cairn::server
