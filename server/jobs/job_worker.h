// Threads that run jobs at low priority, so that they do not slow down streams and queries: one runs those that may
// change maps, one after the other, and one runs those that only look for a robot (OnlyLooks), one after the other, so
// that a robot that is lost does not wait for a job that takes minutes. Both queues are bounded; jobs are refused when
// theirs is full. The work of a job is passed in as a function. If the work ends with an exception, its job fails and
// the worker continues with the next job. The start and the end of each job are logged.
// Thread rule: Submit from any thread; the work runs on the worker's threads, so it may run twice at the same time.
#pragma once

#include <functional>
#include <string>
#include <thread>

#include "common/bounded_channel.h"
#include "server/jobs/job_list.h"

namespace cairn::server {

// The work of a job. `enable`: whether to enable the map version that the job publishes. Returns CANCELLED if
// the work ended because the job was cancelled.
using JobWork = std::function<Result<JobOutcome>(const Job& job, bool enable, const JobControl& control)>;

class JobWorker {
 public:
  JobWorker(const JobsOptions& options, JobList& list, JobWork work);
  ~JobWorker();

  void Start();
  // RESOURCE_EXHAUSTED: the queue is full. `request`: the id (RequestId) of the request that submits it, for the log;
  // empty where the server itself does. The next server does not know it any more.
  Result<Job> Submit(const std::string& site, JobKind kind, bool enable, const std::string& request = "",
                     const JobSubject& about = {});
  // Whether Submit would take a job now that looks for a robot; the errors are those of Submit. Others may take the
  // room before the next call.
  [[nodiscard]] Result<void> CheckRoomToLook() const;
  // Queues a restored job, which is in the list already.
  void Requeue(std::uint64_t id, bool enable);
  // Cancels the running and the waiting jobs, and takes no more. Does not wait: a job may be in the middle of a search
  // that it cannot leave.
  void Cancel();
  // The same. Returns when the threads have ended.
  void Stop();

 private:
  struct Ticket {
    std::uint64_t id = 0;
    bool enable = false;
    std::string request;
  };
  using Queue = BoundedChannel<Ticket>;
  [[nodiscard]] Queue& QueueOf(const Job& job) { return OnlyLooks(job) ? looks_ : changes_; }
  [[nodiscard]] bool IsFull(const Queue& queue) const {
    return queue.size() >= static_cast<std::size_t>(options_.max_queued);
  }
  void Run(Queue& queue);  // Until the queue is closed and empty.
  void RunOne(const Ticket& ticket);
  void GiveUp(std::uint64_t job);
  Result<JobOutcome> Work(const Job& job, bool enable, const JobControl& control) const;

  const JobsOptions options_;
  JobList& list_;
  const JobWork work_;
  Queue changes_;
  Queue looks_;  // OnlyLooks.
  // The last members: they stop before the members they use are destroyed.
  std::jthread changing_;
  std::jthread looking_;
};

}  // namespace cairn::server
