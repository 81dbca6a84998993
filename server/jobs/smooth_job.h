// Full SLAM as a job. It takes a snapshot of every session of the site, smooths the path of each robot's best
// particle (fitted to all steps, revisits and loops: slam/smoothing) and draws the robot's grid along the
// smoothed path. The paths of robots that have seen the same places are fitted together (slam/site); a robot whose
// start was unknown or wrong moves to where the others have seen the same. The result is published as a new map
// version, which is disabled at first. A robot whose place in the map is not known and that is not joined with one
// whose place is known stays a fragment in the new version (maps/robot_grid.h). A job of the kind kJoin makes no
// version unless it joins a fragment. Source: thesis A 5.4 (full-SLAM path of the best particle). Thread rule: runs on
// the job worker's thread. It waits for the sessions and for the site, at most jobs.snapshot_timeout_s each, and for a
// switch of versions that has begun until it is complete; no other thread waits for it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/job_control.h"
#include "server/jobs/jobs_options.h"
#include "server/maps/atlas.h"
#include "server/robots/roster.h"
#include "server/slam/site/site_options.h"

namespace cairn::server {

// The result of smoothing a site, before it is published.
struct SmoothedSite {
  std::optional<MapVersion> version;  // Nothing: a job of the kind kJoin has found nothing to join.
  JobOutcome outcome;                 // Its map_version is still 0.
};

// A pure function: the same material gives the same result. Progress is reported from 0 to 1. `site`: how robots are
// smoothed together; null: each by itself.
// FAILED_PRECONDITION: there are no scans. CANCELLED: the job was cancelled.
[[nodiscard]] Result<SmoothedSite> SmoothSite(const Job& job, const std::vector<SessionMaterial>& material,
                                              const slam::SiteOptions* site, const JobControl& control);

class SmoothJob {
 public:
  SmoothJob(const JobsOptions& options, const slam::SiteOptions& site, const Roster& roster, const Atlas& atlas)
      : options_(options), site_(site), roster_(roster), atlas_(atlas) {}

  // `enable`: whether to enable the new map version.
  Result<JobOutcome> Run(const Job& job, bool enable, const JobControl& control) const;

 private:
  Result<std::vector<SessionMaterial>> Collect(const std::string& site, const JobControl& control) const;
  using Ask = std::function<void(Site&, Site::Done, Site::Wanted)>;
  // Sends `ask` to the site and waits for its answer, a map version. DEADLINE_EXCEEDED, CANCELLED: the site had not
  // begun by then, and will not. What it has begun is waited for, because it can not be taken back.
  Result<std::uint32_t> Await(const std::string& site, const JobControl& control, const Ask& ask) const;

  const JobsOptions options_;
  const slam::SiteOptions site_;
  const Roster& roster_;
  const Atlas& atlas_;
};

}  // namespace cairn::server
