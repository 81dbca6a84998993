// Has robots looked for that are lost. A robot looks for itself in its own map; where somebody has carried it to a part
// of the site that it has not mapped, it is found only in the map of all robots, by a job of the kind kRelocalise
// (relocalise_job.h). One is submitted when the robot has been lost for jobs.relocalise_after_s, and again after twice
// that time, and so on, because a job finds more when the robot has seen more. Other jobs may run meanwhile, of any
// site (job_worker.h); but robots are looked for one at a time, the one first that waits longest, so that a person's
// own search waits for one at most. None while any job for that robot is unfinished, and none for robots that look in
// the map of their site by themselves (those that are only localised) or have no place in it (those that are not joined
// with it). Thread rule: one thread (housekeeping).
#pragma once

#include <chrono>
#include <map>

#include "server/jobs/job_list.h"
#include "server/jobs/job_worker.h"
#include "server/jobs/jobs_options.h"
#include "server/robots/roster.h"

namespace cairn::server {

class LostRobots {
 public:
  using Clock = std::chrono::steady_clock;

  LostRobots(const JobsOptions& options, const Roster& roster, const JobList& jobs, JobWorker& worker)
      : options_(options), roster_(roster), jobs_(jobs), worker_(worker) {}

  // Submits at most one job, and none while another one looks for a robot.
  void Tick(Clock::time_point now = Clock::now());

 private:
  struct Watched {
    Clock::duration wait{};
    Clock::time_point due{};
  };
  void LookFor(const SessionState& state);
  [[nodiscard]] bool MayLookFor(const SessionState& state) const;

  const JobsOptions options_;
  const Roster& roster_;
  const JobList& jobs_;
  JobWorker& worker_;
  Clock::time_point looked_{};
  std::map<SessionId, Watched> lost_;
};

}  // namespace cairn::server
