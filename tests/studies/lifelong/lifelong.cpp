// cairn-study lifelong lets one robot drive for a day of simulated time in one building, through the estimator of this
// process (without a server): what a scan costs, what memory is kept, and how far the poses are from the truth in each
// hour. The building is whole after some minutes, so what grows later grows with time and not with the map. --hours:
// how long (24).
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <deque>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "server/slam/scan_pipeline.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

using StepTimes = std::array<double, slam::kScanStepCount>;

// Where the processor time of the scans goes, in milliseconds.
class StepClock {
 public:
  void Enter(slam::ScanStep step) {
    steps_[static_cast<std::size_t>(step_)] += watch_.CpuMs();
    step_ = step;
    watch_.Restart();
  }
  // The time since the last call is no scan's.
  void Skip() { watch_.Restart(); }
  // Of one scan.
  StepTimes Take() {
    Enter(slam::ScanStep::kOther);
    return std::exchange(steps_, {});
  }

 private:
  Stopwatch watch_;
  slam::ScanStep step_ = slam::ScanStep::kOther;
  StepTimes steps_{};
};

struct Part {
  std::vector<double> scan_ms;
  StepTimes step_ms{};            // Sums.
  double squared_error_m2 = 0.0;  // A sum.
  double largest_error_m = 0.0;
  long long not_localized = 0;
  double heap_mib = 0.0;  // The largest.

  void AddError(double error_m) {
    squared_error_m2 += error_m * error_m;
    largest_error_m = std::max(largest_error_m, error_m);
  }
};

// Bytes in use, without what the allocator has kept back.
double HeapMib() {
  const struct mallinfo2 heap = mallinfo2();
  return static_cast<double>(heap.uordblks + heap.hblkhd) / (1024.0 * 1024.0);
}

// Equal for equal poses, so that two versions of the estimator can be compared.
std::uint64_t Mixed(std::uint64_t hash, double value) {
  return (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x100000001b3U;
}

sim::Fleet OneRobot(std::uint64_t seed) {
  auto world = sim::OpenSurroundings("building");
  if (!world) throw std::runtime_error(world.error().message);
  sim::FleetOptions options;
  options.robots = 1;
  options.laser.beams = 360;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(std::move(*world), options);
  if (!fleet) throw std::runtime_error(fleet.error().message);
  return std::move(*fleet);
}

void RunLifelong(StudyContext& context) {
  Report& report = context.report;
  report.Heading("One robot drives: 10 scans of 360 beams a second");
  const double hours = context.hours > 0.0 ? context.hours : context.Pick(24.0, 0.05);
  const double part_h = std::min(1.0, hours / 2.0);

  sim::Fleet fleet = OneRobot(context.seed);
  Part part;
  StepClock clock;
  std::uint64_t hash = 0xcbf29ce484222325U;
  std::deque<StampedPose> truth;
  const slam::ScanPipeline::Sink sink{
      .used =
          [&](const Scan&, const slam::ScanOutcome& outcome) {
            const StepTimes steps = clock.Take();
            part.scan_ms.push_back(std::accumulate(steps.begin(), steps.end(), 0.0));
            for (std::size_t k = 0; k < steps.size(); ++k) part.step_ms[k] += steps[k];
            part.not_localized += outcome.localized ? 0 : 1;
            const Pose2& pose = outcome.T_map_robot;
            // The estimator may answer later, when it knows the odometry.
            while (!truth.empty() && truth.front().stamp < outcome.stamp) truth.pop_front();
            if (!truth.empty() && truth.front().stamp == outcome.stamp)
              part.AddError((pose.translation() - truth.front().T_map_robot.translation()).norm());
            hash = Mixed(Mixed(Mixed(hash, pose.x), pose.y), pose.theta);
          },
      .dropped = [](const Scan&, DropReason) {}};
  slam::MapperOptions options;
  options.max_keyframes = 100000000;
  slam::ScanPipeline pipeline(options, fleet.T_map_robot_start(0), slam::SerialFor, sink);
  pipeline.mapper().WatchSteps([&clock](slam::ScanStep step) { clock.Enter(step); });

  std::vector<std::string> columns = {"hours",         "mean (ms)",       "p99 (ms)",       "max (ms)",
                                      "keyframes",     "most heap (MiB)", "resident (MiB)", "error rms (m)",
                                      "error max (m)", "not localized"};
  for (const std::string_view step : slam::kScanStepNames) columns.push_back(std::string(step) + " (ms)");
  columns.emplace_back("poses");
  Table table(columns);
  std::vector<double> means, p99s, heaps;
  std::uint64_t scans = 0;
  for (double hour = 0.0; hour + 0.5 * part_h < hours;) {
    sim::FleetRecord next = fleet.Next();
    const bool is_scan = std::holds_alternative<Scan>(next.record);
    auto scan = is_scan ? std::make_shared<const Scan>(std::get<Scan>(std::move(next.record))) : nullptr;
    for (const StampedPose& pose : fleet.TakeTruth(0)) truth.push_back(pose);
    clock.Skip();
    if (is_scan) {
      pipeline.Add(std::move(scan));
    } else {
      pipeline.Add(std::get<Odometry>(next.record));
    }
    if (!is_scan) continue;
    // A server publishes the map about as often.
    if (++scans % 10 == 0) static_cast<void>(pipeline.mapper().TakeGridChange());
    if (scans % 500 == 0) part.heap_mib = std::max(part.heap_mib, HeapMib());
    if (static_cast<double>(part.scan_ms.size()) < part_h * 36000.0) continue;
    hour += part_h;
    const Distribution scan_ms = DistributionOf(part.scan_ms);
    means.push_back(scan_ms.mean);
    p99s.push_back(scan_ms.p99);
    heaps.push_back(part.heap_mib);
    std::vector<std::string> row = {
        Number(hour, 2),
        Number(scan_ms.mean, 3),
        Number(scan_ms.p99, 2),
        Number(scan_ms.max, 1),
        Count(static_cast<long long>(pipeline.mapper().keyframe_count())),
        Number(heaps.back(), 1),
        Number(ResidentMibOf(getpid()), 1),
        Number(std::sqrt(part.squared_error_m2 / static_cast<double>(part.scan_ms.size())), 3),
        Number(part.largest_error_m, 3),
        Count(part.not_localized)};
    for (const double step_ms : part.step_ms)
      row.push_back(Number(step_ms / static_cast<double>(part.scan_ms.size()), 3));
    row.push_back(std::to_string(hash));
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) line += (k > 0 ? ", " : "") + columns[k] + " " + row[k];
    report.Progress(line);
    table.Add(std::move(row));
    part = {};
  }
  report.Add(table, "hours");
}

const Registration kLifelong("lifelong", "a day of one robot in one building: time of a scan and memory in each hour",
                             RunLifelong);

}  // namespace
}  // namespace cairn::studies
