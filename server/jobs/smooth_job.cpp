#include "server/jobs/smooth_job.h"

#include <memory>
#include <utility>

#include "server/jobs/disagreement.h"
#include "server/slam/smoothing/smoothed_path.h"

namespace cairn::server {
namespace {

// Scans drawn and compared so far, as a share of all: what `progress` means.
class Steps {
 public:
  Steps(std::size_t total, const JobControl& control) : total_(total), control_(control) {}
  // False where the job is to end.
  bool Next() {
    control_.Progress(static_cast<double>(++done_) / static_cast<double>(total_));
    return !control_.cancelled();
  }

 private:
  const std::size_t total_;
  std::size_t done_ = 0;
  const JobControl& control_;
};

constexpr int kStepsPerKeyframe = 3;  // Compared before, drawn, compared after.

bool Compare(const slam::MapperSnapshot& snapshot, const std::vector<Pose2>& path, const slam::OccupancyGrid& grid,
             Disagreement& disagreement, Steps& steps) {
  for (std::size_t i = 0; i < snapshot.keyframes.size(); ++i) {
    disagreement.Add(*snapshot.keyframes[i].scan, path[i], grid);
    if (!steps.Next()) return false;
  }
  return true;
}

bool Draw(const slam::MapperSnapshot& snapshot, const std::vector<Pose2>& path, slam::OccupancyGrid& grid,
          Steps& steps) {
  for (std::size_t i = 0; i < snapshot.keyframes.size(); ++i) {
    grid.Draw(*snapshot.keyframes[i].scan, path[i]);
    if (!steps.Next()) return false;
  }
  return true;
}

}  // namespace

Result<JobOutcome> SmoothJob::Run(const Job& job, bool enable, const JobControl& control) const {
  const auto cancelled = Fail(StatusCode::kCancelled, "cancelled");
  const auto material = ports_.collect(job.site, control);
  if (!material) return tl::unexpected(material.error());
  std::size_t keyframes = 0, scans = 0;
  for (const SessionMaterial& session : *material) {
    keyframes += session.snapshot.keyframes.size();
    scans += session.snapshot.scans.size();
  }
  if (keyframes == 0) return Fail(StatusCode::kFailedPrecondition, "site '" + job.site + "' has no scans to smooth");

  Steps steps(kStepsPerKeyframe * keyframes, control);
  Disagreement before, after;
  MapVersion version;
  version.info.job = job.id;
  for (const SessionMaterial& session : *material) {
    const slam::MapperSnapshot& snapshot = session.snapshot;
    const std::vector<Pose2> path = slam::SmoothedPath(snapshot);
    const slam::OccupancyGrid online(session.grid_options, session.chunks);
    slam::OccupancyGrid redrawn(session.grid_options);
    if (!Compare(snapshot, snapshot.online_path, online, before, steps)) return cancelled;
    if (!Draw(snapshot, path, redrawn, steps)) return cancelled;
    if (!Compare(snapshot, path, redrawn, after, steps)) return cancelled;
    version.parts[session.session] = {redrawn.chunks(), snapshot.keyframes.size()};
    version.smoothed[session.robot] = std::make_shared<const Trajectory>(snapshot.TrajectoryAlong(path));
  }
  const std::string summary = std::to_string(material->size()) + " robots, " + std::to_string(keyframes) +
                              " keyframes, " + std::to_string(scans) + " scans";
  version.info.note = "smoothed: " + summary;

  const auto number = ports_.add_version(job.site, std::move(version));
  if (!number) return tl::unexpected(number.error());
  JobOutcome outcome{
      .cost_before = before.mean_m2(), .cost_after = after.mean_m2(), .map_version = *number, .message = summary};
  if (!enable || control.cancelled()) return outcome;
  if (const auto enabled = ports_.enable(job.site, *number); !enabled) return tl::unexpected(enabled.error());
  return outcome;
}

}  // namespace cairn::server
