// Saves sites as files while the server runs and loads them again: the requests to list, save, load and delete. The
// files are NAME.site in one directory; a name cannot contain a path. Each change of the store is one commit between
// two of the journal, so a server that is killed meanwhile has done all of it or nothing. One request after the other;
// the queue is bounded, and a request that finds it full is answered RESOURCE_EXHAUSTED at once. Thread rule: Take from
// any thread; Start and Stop from one.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "common/bounded_channel.h"
#include "server/jobs/job_worker.h"
#include "server/maps/atlas.h"
#include "server/ops/start_control.h"
#include "server/outbound.h"
#include "server/robots/roster.h"
#include "server/store/site_edit.h"

namespace cairn::server {

class SavedSites {
 public:
  struct Rooms {
    Outbound& outbound;
    Roster& roster;
    Atlas& atlas;
    JobList& jobs;
    JobWorker& worker;
  };

  // `journal`: null, or `directory` empty, where nothing is stored: then every request is refused. `max_bytes`: no site
  // is saved while the files of all saved sites take as much.
  SavedSites(std::filesystem::path directory, std::uint64_t max_bytes, Journal* journal, const Rooms& rooms);
  ~SavedSites();

  void Start();
  // REQUIRES: the kind is one of the four.
  void Take(Request&& request);
  // Does not wait for a request that waits for the disk.
  void Stop();

 private:
  static constexpr std::size_t kCapacity = 16;

  void Serve(const Request& request);
  Result<std::vector<SavedSite>> Answer(const Request& request);
  Result<std::vector<SavedSite>> List() const;
  Result<std::vector<SavedSite>> Save(const Request& request);
  Result<std::vector<SavedSite>> Load(const Request& request);
  Result<void> OpenLoaded(const SiteFileSummary& loaded);
  Result<void> Delete(const std::string& site);
  Result<void> DeleteFile(const std::string& name);
  Result<void> DeleteSetAside(const std::string& site);
  Result<bool> DeleteStored(const std::string& site);
  [[nodiscard]] Result<std::filesystem::path> PathOf(const std::string& name) const;
  // Waits for a disk that fails, for a few seconds. UNAVAILABLE, with the reason: it goes on failing.
  Result<void> AwaitDisk() const;
  // Calls `work` between two commits of the journal, and waits for it, or until the disk has failed for some seconds.
  template <typename Value>
  Result<Value> Between(std::function<Result<Value>(Store&)> work);

  const std::filesystem::path directory_;
  const std::uint64_t max_bytes_;
  Journal* const journal_;
  const Rooms rooms_;
  BoundedChannel<Request> requests_{kCapacity};
  std::atomic<bool> stopping_{false};
  StartControl loading_;
  std::jthread thread_;  // The last member, because it uses the members above.
};

}  // namespace cairn::server
