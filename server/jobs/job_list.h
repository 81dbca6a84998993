// Every job the server remembers, and the publication of each change. Bounded: the oldest finished job is forgotten
// first; when nothing finished is left to forget, a new one is refused. Ids are unique for the server's life.
// Thread rule: any thread.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/service/job.h"
#include "server/jobs/job_control.h"
#include "server/jobs/jobs_options.h"
#include "server/outbound.h"

namespace cairn::server {

class JobList {
 public:
  // `send` publishes and never waits; `now` is the server's clock.
  JobList(const JobsOptions& options, std::function<bool(OutboundValue)> send, std::function<Stamp()> now);

  // A new job, queued. RESOURCE_EXHAUSTED.
  Result<Job> Add(const std::string& site, JobKind kind);
  // False where it was cancelled meanwhile. From then on Cancel reaches the running work through its control.
  bool Start(std::uint64_t id);
  void Succeed(std::uint64_t id, const JobOutcome& outcome);
  // kCancelled where the status is CANCELLED, else kFailed.
  void Fail(std::uint64_t id, const Status& status);
  // NOT_FOUND; FAILED_PRECONDITION where it is over. Running work ends when it next looks.
  Result<Job> Cancel(std::uint64_t id);
  void CancelAll();

  [[nodiscard]] Result<Job> Find(std::uint64_t id) const;
  [[nodiscard]] std::vector<Job> OfSite(const std::string& site) const;  // Of all sites where empty.
  [[nodiscard]] std::shared_ptr<const JobControl> ControlOf(std::uint64_t id) const;
  // Publishes what could not be published before.
  void Tick();

 private:
  struct Entry {
    Job job;
    std::shared_ptr<JobControl> control;
    bool unsent = false;
    std::chrono::steady_clock::time_point progress_sent{};
  };
  void Progress(std::uint64_t id, double progress);
  void SendLocked(Entry& entry) CAIRN_REQUIRES(mutex_);
  bool MakeRoom() CAIRN_REQUIRES(mutex_);
  void End(std::uint64_t id, JobState state, const std::function<void(Job&)>& fill);

  const JobsOptions options_;
  const std::function<bool(OutboundValue)> send_;
  const std::function<Stamp()> now_;
  mutable Mutex mutex_;
  std::map<std::uint64_t, Entry> jobs_ CAIRN_GUARDED_BY(mutex_);
  std::uint64_t next_ CAIRN_GUARDED_BY(mutex_) = 1;
};

}  // namespace cairn::server
