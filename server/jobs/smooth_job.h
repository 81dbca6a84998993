// Full SLAM as a job: takes what every session of the site knows at one moment, smooths each robot's path (that of its
// best particle, fitted to all steps, revisits and loops: slam/smoothing), with its grid drawn along it, and publishes
// the result as a new map version, disabled until it is enabled. Robots are smoothed each by itself: relations between
// them are not sought. Source: thesis A 5.4 (full-SLAM path of the best particle). Thread rule: runs on the job
// worker's thread; it may wait for sessions, nobody waits for it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/job_worker.h"
#include "server/maps/map_versions.h"

namespace cairn::server {

// What the job needs of the house; each may wait, bounded.
struct SmoothPorts {
  std::function<Result<std::vector<SessionMaterial>>(const std::string& site, const JobControl&)> collect;
  std::function<Result<std::uint32_t>(const std::string& site, MapVersion&&)> add_version;
  std::function<Result<std::uint32_t>(const std::string& site, std::uint32_t version)> enable;
};

class SmoothJob {
 public:
  explicit SmoothJob(SmoothPorts ports) : ports_(std::move(ports)) {}

  Result<JobOutcome> Run(const Job& job, bool enable, const JobControl& control) const;

 private:
  SmoothPorts ports_;
};

}  // namespace cairn::server
