// What smoothing jobs have measured, one book for each site (slam/site/relation_book.h), kept in memory and in the
// store: one record for every two sessions, under the session in which something was looked at. A record is removed
// with its session. Records that are missing or cannot be read only cost time: what they held is measured again.
// Thread rule: one thread (the job worker's).
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "server/slam/site/relation_book.h"
#include "server/store/journal.h"

namespace cairn::server {

class RelationBooks {
 public:
  // `journal`: null if nothing is stored.
  explicit RelationBooks(Journal* journal = nullptr) : journal_(journal) {}

  // The book of a site. What is stored of a session is read when it is named for the first time.
  slam::RelationBook& Open(const std::string& site, const std::vector<std::uint64_t>& sessions);
  // Stores what has changed. `sessions`: those that there are; what was measured of others is forgotten. `site_exists`:
  // books of other sites are forgotten.
  void Close(const std::string& site, const std::vector<std::uint64_t>& sessions,
             const std::function<bool(const std::string& site)>& site_exists);

 private:
  void Restore(slam::RelationBook& book, std::uint64_t session) const;

  Journal* const journal_;
  struct SiteBook {
    slam::RelationBook book;
    std::set<std::uint64_t> restored;  // Sessions whose records have been read.
  };
  std::map<std::string, SiteBook> books_;
};

}  // namespace cairn::server
