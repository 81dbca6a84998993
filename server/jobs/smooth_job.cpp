#include "server/jobs/smooth_job.h"

#include <memory>
#include <utility>

#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::server {

Result<JobOutcome> SmoothJob::Run(const Job& job, bool enable, const JobControl& control) const {
  const auto material = ports_.collect(job.site, control);
  if (!material) return tl::unexpected(material.error());
  std::size_t keyframes = 0, scans = 0;
  for (const SessionMaterial& session : *material) {
    keyframes += session.snapshot.keyframes.size();
    scans += session.snapshot.scans.size();
  }
  if (keyframes == 0) return Fail(StatusCode::kFailedPrecondition, "site '" + job.site + "' has no scans to smooth");

  // Progress is the share of scans drawn and compared.
  const double steps = static_cast<double>(slam::kSmoothingStepsPerKeyframe) * static_cast<double>(keyframes);
  std::size_t done = 0;
  const auto next = [&] {
    control.Progress(static_cast<double>(done++) / steps);
    return !control.cancelled();
  };
  slam::Disagreement before, after;
  MapVersion version;
  version.info.job = job.id;
  for (const SessionMaterial& session : *material) {
    const slam::MapperSnapshot& snapshot = session.snapshot;
    const auto map = slam::SmoothMap(snapshot, session.grid_options, next);
    if (!map) return Fail(StatusCode::kCancelled, "cancelled");
    before.Add(map->before);
    after.Add(map->after);
    version.parts[session.session] = {map->grid.chunks(), snapshot.keyframes.size()};
    version.smoothed[session.robot] = std::make_shared<const Trajectory>(snapshot.TrajectoryAlong(map->path));
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
