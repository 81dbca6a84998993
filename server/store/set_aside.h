// What a server has not restored: records that cannot be read, and the sessions and sites that need them. Such records
// stay in the store as they are, and everything else is restored without them. Thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "server/store/store.h"

namespace cairn::server {

class SetAside {
 public:
  // `site` may be empty: it is not known. Returns the line for the log.
  std::string Add(const std::string& site, const std::string& what, const Status& why);
  // The site was deleted, with all its records.
  void RemoveSite(const std::string& site);
  // For a person, in a few hundred bytes; empty if nothing is set aside.
  [[nodiscard]] std::string text() const;

 private:
  struct Entry {
    std::string site;
    std::string line;
    bool operator==(const Entry&) const = default;
  };

  mutable Mutex mutex_;
  std::vector<Entry> entries_ CAIRN_GUARDED_BY(mutex_);
};

// As Store::Read, but each record on its own: for one that cannot be read, or for which `visit` returns an error,
// `unreadable` is called, and the reading goes on.
[[nodiscard]] Result<void> ReadEach(Store& store, const RecordRange& range, const Store::Visit& visit,
                                    const std::function<void(std::uint64_t number, const Status& why)>& unreadable);

}  // namespace cairn::server
