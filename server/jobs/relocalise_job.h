// Looks for a robot in the whole map of its site, which shows more than the map of the robot itself: what other robots
// and earlier sessions have drawn. The last scans of the robot are compared with all of the map (slam/recovery,
// PlaceSearch::Rank): branch and bound, with a bound on its work. All places that may be its own are ranked. If one has
// no rival, the robot is told, and its next scans have to confirm it (slam::Recovery::Suggest); otherwise nothing is
// changed. Where somebody has said where a robot is that is lost, it is looked for there first, and a rival elsewhere
// does not count. A robot that is not joined with the map of its site, and of which somebody says where it is, is
// joined there if what it has seen agrees with the map; if it does not, nothing is changed. Thread rule: runs on the
// job worker's threads. It waits for the session, and for the site, at most jobs.snapshot_timeout_s each.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "common/bounded_channel.h"
#include "server/jobs/job_control.h"
#include "server/jobs/jobs_options.h"
#include "server/jobs/smooth_job.h"
#include "server/maps/atlas.h"
#include "server/robots/roster.h"
#include "server/slam/recovery/place_search.h"
#include "server/slam/site/site_options.h"

namespace cairn::server {

// Where a robot may be, before anybody is told.
struct LookedFor {
  JobOutcome outcome;
  std::optional<slam::FoundPlace> found;  // The only place where it can be.
};

// A pure function: the same scans and the same map give the same result. `scans`: the last ones of the robot, in the
// order of time. `T_map_said`: where somebody says that the robot was at the last of them. If what it sees agrees with
// the map there, that place is the only one, whatever looks like it elsewhere. FAILED_PRECONDITION: there are no scans.
// CANCELLED: the job was cancelled.
[[nodiscard]] Result<LookedFor> LookForRobot(const std::string& robot, std::span<const slam::RecentScan> scans,
                                             const slam::SearchedMap& map, const slam::SiteOptions& options,
                                             const JobControl& control,
                                             const std::optional<Pose2>& T_map_said = std::nullopt);

class RelocaliseJob {
 public:
  RelocaliseJob(const JobsOptions& options, const slam::SiteOptions& site, const Roster& roster, const Atlas& atlas,
                const SmoothJob& smooth)
      : options_(options), site_(site), roster_(roster), atlas_(atlas), smooth_(smooth) {}

  // `job.places`: where somebody says that the robot is; only for a robot that is not joined with the map.
  Result<JobOutcome> Run(const Job& job, const JobControl& control) const;

 private:
  // The map of the site in which robots are looked for.
  struct SiteMap {
    LocaliseTaken tiles;
    std::shared_ptr<const slam::KnownGrid> grid;
  };
  [[nodiscard]] Result<SiteMap> MapOf(const Site& site) const;
  [[nodiscard]] Result<SessionMaterial> Collect(Session& session, const JobControl& control) const;
  [[nodiscard]] Result<SessionMaterial> AskForMaterial(Session& session, const JobControl& control) const;
  // Whether the robot's next scans will confirm the place.
  [[nodiscard]] Result<bool> Tell(Session& session, PlaceFound&& found, const JobControl& control) const;
  [[nodiscard]] Result<JobOutcome> JoinWhereSaid(const Job& job, const SessionMaterial& material, const SiteMap& map,
                                                 const JobControl& control) const;
  template <typename Answer>
  [[nodiscard]] Result<Answer> WaitFor(BoundedChannel<Answer>& answers, const JobControl& control) const;

  const JobsOptions options_;
  const slam::SiteOptions site_;
  const Roster& roster_;
  const Atlas& atlas_;
  const SmoothJob& smooth_;
};

}  // namespace cairn::server
