// Submits jobs that join robots with the map of their site. A robot that did not say where it starts is a fragment: its
// part of the map is not shown (robots/roster.h). A job of the kind kJoin looks for places that it and others have
// seen, and, where it finds enough of them, makes and enables a map version that contains the fragment. A job takes
// time that grows with the map, so one is submitted when a fragment has driven jobs.join_way_m, and again only when it,
// or those with whom it may be joined, have driven a tenth more. Such a job also fits robots that said where they
// start to each other (jobs.align), so that a site's map stays right without a person. For these one is submitted when
// two of them have driven jobs.join_way_m, and again when all have driven a quarter more; not while a person has chosen
// the enabled map version (Site::MayBeAligned). In both cases 200 m of one robot that drives are enough, however far
// others have driven before. Thread rule: one thread (housekeeping).
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "server/jobs/job_list.h"
#include "server/jobs/job_worker.h"
#include "server/jobs/jobs_options.h"
#include "server/maps/atlas.h"
#include "server/robots/roster.h"

namespace cairn::server {

class Joiner {
 public:
  Joiner(const JobsOptions& options, const Roster& roster, const Atlas& atlas, const JobList& jobs, JobWorker& worker)
      : options_(options), roster_(roster), atlas_(atlas), jobs_(jobs), worker_(worker) {}

  // Submits the jobs that are due, at most one per site. None while the site has a job that has not ended and may
  // change its map, because that job may join the fragment, and none where such a job has ended servers
  // (JobList::EndsServers).
  void Tick();

 private:
  // How far the sessions of a site have driven, in metres.
  struct Driven {
    std::map<SessionId, double> fragments;
    double others_m = 0.0;
    std::size_t far = 0;                  // How many of the others have driven far enough to be fitted to each other,
    std::map<SessionId, double> today{};  // and those of them that have not ended.
  };
  [[nodiscard]] std::map<std::string, Driven> Look() const;
  [[nodiscard]] bool IsDue(const std::string& site, const Driven& now) const;
  [[nodiscard]] bool IsDueToAlign(const std::string& site, const Driven& now) const;
  [[nodiscard]] bool HasWork(const std::string& site) const;

  const JobsOptions options_;
  const Roster& roster_;
  const Atlas& atlas_;
  const JobList& jobs_;
  JobWorker& worker_;
  std::map<std::string, Driven> tried_;  // By site: at the last job.
};

}  // namespace cairn::server
