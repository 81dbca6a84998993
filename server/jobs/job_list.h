// All jobs that the server keeps; every change of a job is published. The list is bounded: a new job replaces
// the oldest finished one, and is refused if no job is finished. Of the jobs of a site that looked for something to
// join and found nothing, only the last one is kept. Ids are unique while the server runs. Thread rule: any thread.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/mutex.h"
#include "common/service/job.h"
#include "server/jobs/job_control.h"
#include "server/jobs/jobs_options.h"
#include "server/outbound.h"
#include "server/store/journal.h"

namespace cairn::server {

// Why a job is refused.
inline constexpr std::string_view kTooManyUnfinished = "too many jobs are unfinished (jobs.max_kept); try again later";

// What a job of the kind kRelocalise is about.
struct JobSubject {
  std::string robot;
  std::vector<PoseHypothesis> places{};  // Where somebody says that the robot is. At the job's end: where it may be.
};

// Whether the job only looks for a robot: it makes no map version, and nothing else has to wait for it. REQUIRES: the
// job has not ended, because the places of one that has are those it has found.
[[nodiscard]] inline bool OnlyLooks(const Job& job) {
  return job.kind == JobKind::kRelocalise && job.places.empty();
}

class JobList {
 public:
  // `now` is the server's clock. `journal`: null if nothing is stored.
  JobList(const JobsOptions& options, Outbound& outbound, std::function<Stamp()> now, Journal* journal = nullptr);

  // Restores the jobs of earlier servers. Those that had not ended are queued again and returned in the order of their
  // ids, but for one that ran in each of the last eight servers when they died: it fails, because it may be the cause
  // (a job that needs more memory than there is). REQUIRES: no other function was called before.
  Result<std::vector<StoredJob>> Restore();
  // Jobs that are loaded while the server runs: the first of so many numbers that no other job gets, and then the jobs
  // themselves, as Restore takes them.
  [[nodiscard]] std::uint64_t ReserveIds(std::uint64_t count);
  Result<std::vector<StoredJob>> AddStored(const std::vector<std::uint64_t>& ids);
  // The site is deleted: its jobs that have ended are removed from memory; their records stay.
  void RemoveSite(const std::string& site);
  // Adds a queued job. RESOURCE_EXHAUSTED: the list is full of unfinished jobs. `enable`: see JobWorker.
  Result<Job> Add(const std::string& site, JobKind kind, bool enable = true, const JobSubject& about = {});
  // Whether Add has room for a job now.
  [[nodiscard]] bool HasRoom() const;
  // Marks the job as running. Returns false if it was cancelled meanwhile. From now on Cancel sets the flag
  // in the job's JobControl.
  bool Start(std::uint64_t id);
  void Succeed(std::uint64_t id, const JobOutcome& outcome);
  // Ends the job as kCancelled if the status is CANCELLED, else as kFailed.
  void Fail(std::uint64_t id, const Status& status);
  // NOT_FOUND: no such job. FAILED_PRECONDITION: the job has already ended. Running work ends at its next
  // check.
  Result<Job> Cancel(std::uint64_t id);
  // Cancels all jobs because the server stops. If jobs are stored, the next server starts them again.
  void CancelAll();

  [[nodiscard]] Result<Job> Find(std::uint64_t id) const;
  [[nodiscard]] std::vector<Job> OfSite(const std::string& site) const;  // An empty name: the jobs of all sites.
  // Whether a job of this kind failed because servers died while it ran. Another one would do the same.
  [[nodiscard]] bool EndsServers(const std::string& site, JobKind kind) const;
  [[nodiscard]] std::shared_ptr<const JobControl> ControlOf(std::uint64_t id) const;
  // Publishes the changes that could not be published before.
  void Tick();

 private:
  struct Entry {
    Job job;
    bool enable = true;
    std::uint32_t attempts = 0;  // StoredJob::attempts.
    std::shared_ptr<JobControl> control;
    bool unsent = false;
    std::chrono::steady_clock::time_point progress_sent{};
  };
  void Progress(std::uint64_t id, double progress);
  void SendLocked(Entry& entry) CAIRN_REQUIRES(mutex_);
  void ChangedLocked(Entry& entry) CAIRN_REQUIRES(mutex_);
  Result<void> RestoreOne(std::uint64_t id, std::vector<StoredJob>& unfinished) CAIRN_REQUIRES(mutex_);
  bool MakeRoom() CAIRN_REQUIRES(mutex_);
  void RetireReplaced() CAIRN_REQUIRES(mutex_);
  void RemoveVainBefore(const Job& last) CAIRN_REQUIRES(mutex_);
  void End(std::uint64_t id, JobState state, const std::function<void(Job&)>& fill);

  const JobsOptions options_;
  Outbound& outbound_;
  const std::function<Stamp()> now_;
  Journal* const journal_;
  mutable Mutex mutex_;
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;
  std::map<std::uint64_t, Entry> jobs_ CAIRN_GUARDED_BY(mutex_);
  std::vector<Job> replaced_ CAIRN_GUARDED_BY(mutex_);  // Their keys are not retired yet.
  std::uint64_t next_ CAIRN_GUARDED_BY(mutex_) = 1;
};

}  // namespace cairn::server
