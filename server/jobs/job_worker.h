// The thread that does jobs, one after the other, at low priority, so that streaming and queries go on. Bounded queue:
// a full one refuses. What a kind of job does is handed in as a function.
// Thread rule: Submit from any thread; the work runs on the worker's thread.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <thread>

#include "common/bounded_channel.h"
#include "server/jobs/job_list.h"

namespace cairn::server {

// `enable`: make the map version it publishes the enabled one. Status CANCELLED where it found itself cancelled.
using JobWork = std::function<Result<JobOutcome>(const Job& job, bool enable, const JobControl& control)>;

class JobWorker {
 public:
  JobWorker(const JobsOptions& options, JobList& list, std::map<JobKind, JobWork> works);
  ~JobWorker();

  void Start();
  // UNIMPLEMENTED for a kind without work; RESOURCE_EXHAUSTED where the queue is full.
  Result<Job> Submit(const std::string& site, JobKind kind, bool enable);
  // Cancels what runs and waits; returns when the thread has ended.
  void Stop();

 private:
  struct Ticket {
    std::uint64_t id = 0;
    bool enable = false;
  };
  void Run(const std::stop_token& stop);

  const JobsOptions options_;
  JobList& list_;
  const std::map<JobKind, JobWork> works_;
  BoundedChannel<Ticket> queue_;
  std::jthread thread_;  // Last: stops before anything it uses goes.
};

}  // namespace cairn::server
