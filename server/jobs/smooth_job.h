// Full SLAM as a job. It takes a snapshot of every session of the site, smooths the path of each robot's best
// particle (fitted to all steps, revisits and loops: slam/smoothing) and draws the robot's grid along the
// smoothed path. The paths of robots that have seen the same places are fitted together (slam/site); a robot whose
// start was unknown or wrong moves to where the others have seen the same. The result is published as a new map
// version, which is disabled at first. A robot whose place in the map is not known and that is not joined with one
// whose place is known stays a fragment in the new version (maps/robot_grid.h). A job of the kind kJoin makes no
// version unless it joins a fragment, fits robots that said where they start better to each other (alignment.h), or
// finds that one was joined at a wrong place (both only where no person has chosen the enabled version, and no other
// job of the site waits that may change its map); and it joins no robot that a person has taken out of the map
// (Site::kept_apart). Source: thesis A 5.4 (full-SLAM path of the best particle). Thread
// rule: runs on one thread of the job worker. It waits for the sessions and for the site, at most
// jobs.snapshot_timeout_s each, and for a switch of versions that has begun until it is complete; no other thread waits
// for it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/jobs/alignment.h"
#include "server/jobs/job_control.h"
#include "server/jobs/job_list.h"
#include "server/jobs/jobs_options.h"
#include "server/jobs/kept_drawings.h"
#include "server/jobs/relation_books.h"
#include "server/maps/atlas.h"
#include "server/robots/roster.h"
#include "server/slam/site/relation_book.h"
#include "server/slam/site/site_options.h"

namespace cairn::server {

// The result of smoothing a site, before it is published.
struct SmoothedSite {
  std::optional<MapVersion> version;  // Nothing: a job of the kind kJoin has found nothing to do.
  bool aligns = false;                // It joins nobody, and only fits robots to each other.
  JobOutcome outcome;                 // Its map_version is still 0.
};

// A pure function: the same material, book and drawings give the same result. Progress is reported from 0 to 1. `site`:
// how robots are smoothed together; null: each by itself. `book`: see SmoothSessions. `align`: whether a job of the
// kind kJoin also fits robots that said where they start to each other. `drawings`: what the last job of the site drew;
// what this one draws replaces it. Null: all is drawn anew. FAILED_PRECONDITION: there are no scans. CANCELLED: the job
// was cancelled.
[[nodiscard]] Result<SmoothedSite> SmoothSite(const Job& job, const std::vector<SessionMaterial>& material,
                                              const slam::SiteOptions* site, const JobControl& control,
                                              slam::RelationBook* book = nullptr, bool align = false,
                                              KeptDrawings::OfSite* drawings = nullptr);

class SmoothJob {
 public:
  // `journal`: null if nothing is stored. `jobs`: all jobs; null: there are no others.
  SmoothJob(const JobsOptions& options, const slam::SiteOptions& site, const Roster& roster, const Atlas& atlas,
            Journal* journal = nullptr, const JobList* jobs = nullptr)
      : options_(options), site_(site), roster_(roster), atlas_(atlas), jobs_(jobs), books_(journal) {}

  // `enable`: whether to enable the new map version.
  Result<JobOutcome> Run(const Job& job, bool enable, const JobControl& control);

  using Ask = std::function<void(Site&, Site::Done, Site::Wanted)>;
  // Sends `ask` to the site and waits for its answer, a map version. DEADLINE_EXCEEDED, CANCELLED: the site had not
  // begun by then, and will not. What it has begun is waited for, because it can not be taken back.
  Result<std::uint32_t> Await(const std::string& site, const JobControl& control, const Ask& ask) const;

 private:
  // Whether the job may make a version that nobody has asked for.
  [[nodiscard]] bool MayAlign(const Job& job) const;
  // Sessions of the site that a person has taken out of its map (Site::kept_apart).
  [[nodiscard]] std::set<SessionId> KeptApart(const std::string& site) const;
  Result<SmoothedSite> Smooth(const Job& job, const std::vector<SessionMaterial>& material, const JobControl& control);
  Result<std::vector<SessionMaterial>> Collect(const std::string& site, const JobControl& control) const;

  const JobsOptions options_;
  const slam::SiteOptions site_;
  const Roster& roster_;
  const Atlas& atlas_;
  const JobList* const jobs_;
  RelationBooks books_;
  KeptDrawings drawings_;
  AlignmentPace aligned_;
};

}  // namespace cairn::server
