#include "tests/studies/dpslam/grid_drive.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include "server/slam/scan/odometry_pairing.h"

namespace cairn::studies {
namespace {

slam::ParallelFor Over(int threads) {
  if (threads <= 1) return slam::SerialFor;
  return [threads](int size, const std::function<void(int, int)>& body) {
    const int blocks = std::min(threads, size);
    std::vector<std::thread> workers;
    for (int b = 1; b < blocks; ++b) workers.emplace_back([&, b] { body(size * b / blocks, size * (b + 1) / blocks); });
    if (blocks > 0) body(0, size / blocks);
    for (std::thread& worker : workers) worker.join();
  };
}

}  // namespace

std::vector<GridStep> GridSteps(const StudyLog& log, double gate_m, double gate_rad) {
  std::vector<GridStep> steps;
  Pose2 T_odom_last;
  const auto paired = [&](slam::PairedScan&& pair) {
    const Pose2 step = steps.empty() ? Pose2{} : Between(T_odom_last, pair.T_odom_robot);
    if (!steps.empty() && step.translation().norm() < gate_m && std::abs(step.theta) < gate_rad) return;
    steps.push_back({pair.scan->stamp, step, pair.at_stamp});
    T_odom_last = pair.T_odom_robot;
  };
  slam::OdometryPairing pairing({}, {.paired = paired, .dropped = [](const Scan&, DropReason) {}});
  for (const LogRecord& record : log.records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry)) pairing.Add(*odometry);
    } else if (const Scan& scan = std::get<Scan>(record); ValidateScan(scan)) {
      pairing.Add(std::make_shared<const Scan>(scan));
    }
  }
  pairing.Finish();
  return steps;
}

double GridRun::PeakMib() const {
  return map_mib.empty() ? 0.0 : *std::max_element(map_mib.begin(), map_mib.end());
}

GridRun RunGrid(const std::string& name, const std::vector<GridStep>& steps, const Pose2& T_map_robot_start,
                const slam::DpSlamOptions& options, std::uint64_t seed, int threads) {
  constexpr double kMib = 1024.0 * 1024.0;
  GridRun run;
  run.name = name;
  slam::DpSlam filter(options, T_map_robot_start, seed);
  const slam::ParallelFor parallel_for = Over(threads);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    Stopwatch watch;
    if (i > 0) filter.Predict({steps[i].T_prev_curr});
    filter.Observe(std::make_shared<slam::LaserRays>(RaysOf(*steps[i].scan, options.opacity)), parallel_for);
    filter.Commit();
    run.cpu_ms.push_back(watch.CpuMs());
    run.wall_ms.push_back(watch.WallMs());
    run.map_mib.push_back(static_cast<double>(filter.bytes()) / kMib);
    for (const slam::LevelFilter* level : {&filter.low(), filter.high()}) {
      if (level == nullptr) continue;
      const slam::Ancestry& ancestry = level->maps().ancestry();
      const std::size_t living = ancestry.living().size(), depth = ancestry.depth();
      run.most_nodes = std::max(run.most_nodes, ancestry.size());
      run.longest_line = std::max(run.longest_line, depth);
      run.bounds_hold = run.bounds_hold && ancestry.size() <= 2 * living - 1 && depth <= living;
    }
    run.diverged += filter.health().diverged ? 1 : 0;
  }
  const slam::LevelFilter& top = filter.high() != nullptr ? *filter.high() : filter.low();
  run.log_likelihood = top.best().log_likelihood;
  const slam::Hypothesis best = filter.hypothesis(0);
  for (std::size_t k = 0; k < steps.size(); ++k) run.path.push_back({steps[k].stamp, best.path[k]});
  run.map = filter.MapImage();
  const double cells = static_cast<double>(run.map.width) * run.map.height;
  const auto maps = options.low.particles + (options.hierarchical ? options.high.particles : 0);
  run.naive_mib = 4.0 * cells * static_cast<double>(maps) / kMib;
  return run;
}

LoopError LoopErrorOf(const Trajectory& path, const Trajectory& truth, double apart_m) {
  // The truth at the stamps of the path, and the way to each.
  std::vector<Pose2> places;
  std::vector<double> way;
  std::size_t t = 0;
  for (const auto& pose : path) {
    while (t + 1 < truth.size() && truth[t].stamp < pose.stamp) ++t;
    const Pose2& place = truth[t].T_map_robot;
    way.push_back(places.empty() ? 0.0 : way.back() + (place.translation() - places.back().translation()).norm());
    places.push_back(place);
  }
  LoopError error;
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = i + 1; j < places.size(); ++j) {
      if (way[j] - way[i] < apart_m || (places[j].translation() - places[i].translation()).norm() > 1.0) continue;
      const Pose2 wrong = Between(Between(places[i], places[j]), Between(path[i].T_map_robot, path[j].T_map_robot));
      error.trans_m += wrong.translation().norm();
      error.rot_deg += std::abs(wrong.theta) * 180.0 / kPi;
      ++error.pairs;
    }
  if (error.pairs > 0) error.trans_m /= error.pairs, error.rot_deg /= error.pairs;
  return error;
}

}  // namespace cairn::studies
