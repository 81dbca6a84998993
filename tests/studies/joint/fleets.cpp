#include "tests/studies/joint/fleets.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "client/sim/fleet.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/site/site_smoothing.h"
#include "server/slam/site_options_of.h"

namespace cairn::studies {
namespace {

constexpr int kRobots = 3;
constexpr double kWrongM = 0.5, kWrongRad = 0.1;

std::vector<slam::MapperSnapshot> Drive(sim::Fleet& fleet, double seconds, Stamp first_stamp,
                                        const slam::MapperOptions& options) {
  std::vector<std::unique_ptr<slam::ScanPipeline>> robots;
  for (int i = 0; i < kRobots; ++i) {
    robots.push_back(std::make_unique<slam::ScanPipeline>(
        options, Pose2{}, slam::SerialFor,
        slam::ScanPipeline::Sink{.used = [](const Scan&, const slam::ScanOutcome&) {},
                                 .dropped = [](const Scan&, DropReason) {}}));
  }
  const Stamp end = first_stamp + StampFromSeconds(seconds);
  for (;;) {
    sim::FleetRecord record = fleet.Next();
    if (std::visit([](const auto& value) { return value.stamp; }, record.record) > end) break;
    slam::ScanPipeline& robot = *robots[static_cast<std::size_t>(record.robot)];
    if (const auto* odometry = std::get_if<Odometry>(&record.record))
      robot.Add(*odometry);
    else
      robot.Add(std::make_shared<const Scan>(std::get<Scan>(std::move(record.record))));
  }
  std::vector<slam::MapperSnapshot> snapshots;
  for (const auto& robot : robots) {
    robot->Finish();
    snapshots.push_back(robot->mapper().Snapshot());
  }
  return snapshots;
}

// The true poses of the keyframes.
std::vector<Pose2> TruthAt(const slam::MapperSnapshot& snapshot, const Trajectory& truth) {
  std::vector<Pose2> poses;
  for (const slam::Keyframe& keyframe : snapshot.keyframes) {
    const auto at = std::ranges::lower_bound(truth, keyframe.scan->stamp, {}, &StampedPose::stamp);
    poses.push_back(at == truth.end() ? truth.back().T_map_robot : at->T_map_robot);
  }
  return poses;
}

// How far keyframes of one robot are from their true places, seen from those of others where these have been as well:
// elsewhere each drifts by itself.
struct Distance {
  double sum_m = 0.0, sum_rad = 0.0;
  int compared = 0;

  void Add(const std::vector<Pose2>& path_a, const std::vector<Pose2>& truth_a, const std::vector<Pose2>& path_b,
           const std::vector<Pose2>& truth_b) {
    constexpr double kNearM = 3.0;
    for (std::size_t k = 0; k < path_b.size(); ++k) {
      const auto away = [&](const Pose2& pose) { return (pose.translation() - truth_b[k].translation()).norm(); };
      const auto nearest = static_cast<std::size_t>(std::ranges::min_element(truth_a, {}, away) - truth_a.begin());
      if (away(truth_a[nearest]) > kNearM) continue;
      ++compared;
      const Pose2 truth = Between(truth_a[nearest], truth_b[k]);
      const Pose2 seen = Between(path_a[nearest], path_b[k]);
      sum_m += (seen.translation() - truth.translation()).norm();
      sum_rad += std::abs(WrapAngle(seen.theta - truth.theta));
    }
  }
  // Robots that are joined without having been at one place are at a wrong one.
  [[nodiscard]] double mean_m() const {
    return compared > 0 ? sum_m / compared : std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] double mean_rad() const { return compared > 0 ? sum_rad / compared : 0.0; }
  [[nodiscard]] bool IsWrong() const { return mean_m() > kWrongM || mean_rad() > kWrongRad; }
};

FleetJoin Join(const std::vector<slam::MapperSnapshot>& snapshots, const std::vector<std::vector<Pose2>>& truths,
               const slam::MapperOptions& options, slam::SiteSearch search) {
  std::vector<slam::SiteSession> sessions;
  for (const slam::MapperSnapshot& snapshot : snapshots)
    sessions.push_back({snapshot, search == slam::SiteSearch::kFragments && sessions.empty()});
  const auto smoothed = slam::SmoothSessions(
      sessions, SiteOptionsOf(options), [](double /*share*/) { return true; }, search);
  FleetJoin result{.robots = kRobots};
  double sum_m = 0.0;
  for (std::size_t i = 0; i < smoothed->size(); ++i) {
    const slam::SmoothedSession& session = (*smoothed)[i];
    if (!session.joined) continue;
    ++result.joined;
    Distance distance;
    for (std::size_t other = 0; other < smoothed->size(); ++other)
      if (other != i && (*smoothed)[other].frame == session.frame)
        distance.Add((*smoothed)[other].path, truths[other], session.path, truths[i]);
    result.wrong += distance.IsWrong() ? 1 : 0;
    if (!distance.IsWrong()) sum_m += distance.mean_m();
    result.most_m = std::max(result.most_m, distance.mean_m());
    result.most_rad = std::max(result.most_rad, distance.mean_rad());
  }
  result.error_m = sum_m / std::max(1, result.joined - result.wrong);
  return result;
}

}  // namespace

FleetJoins JoinFleet(const ConsistencyDrive& drive, const slam::MapperOptions& options, std::uint64_t seed) {
  sim::FleetOptions robots;
  robots.robots = kRobots;
  robots.scan_hz = 4.0;
  robots.odometry_hz = 20.0;
  robots.laser.beams = 180;
  robots.laser.range_max_m = 10.0;
  robots.laser.error.sigma_m = 0.02;
  robots.seed = seed;
  auto fleet = sim::Fleet::Create(drive.world, robots);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  const auto snapshots = Drive(*fleet, drive.seconds, robots.first_stamp, options);

  std::vector<std::vector<Pose2>> truths;
  for (int i = 0; i < kRobots; ++i) truths.push_back(TruthAt(snapshots[static_cast<std::size_t>(i)], fleet->truth(i)));
  return {.together = Join(snapshots, truths, options, slam::SiteSearch::kAll),
          .fragments = Join(snapshots, truths, options, slam::SiteSearch::kFragments)};
}

}  // namespace cairn::studies
