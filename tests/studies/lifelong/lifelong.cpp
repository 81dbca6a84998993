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

sim::Fleet RobotsInTheBuilding(int robots, std::uint64_t seed) {
  auto world = sim::OpenSurroundings("building");
  if (!world) throw std::runtime_error(world.error().message);
  sim::FleetOptions options;
  options.robots = robots;
  options.laser.beams = 360;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(std::move(*world), options);
  if (!fleet) throw std::runtime_error(fleet.error().message);
  return std::move(*fleet);
}

// The estimators of some robots, and what they have cost in this hour.
class Drive {
 public:
  Drive(int robots, std::uint64_t seed) : fleet_(RobotsInTheBuilding(robots, seed)) {
    slam::MapperOptions options;
    options.max_keyframes = 100000000;
    for (int robot = 0; robot < robots; ++robot) {
      robots_.push_back(std::make_unique<Robot>());
      Robot& one = *robots_.back();
      const slam::ScanPipeline::Sink sink{
          .used = [this, &one](const Scan&, const slam::ScanOutcome& outcome) { Take(one, outcome); },
          .dropped = [](const Scan&, DropReason) {}};
      one.pipeline =
          std::make_unique<slam::ScanPipeline>(options, fleet_.T_map_robot_start(robot), slam::SerialFor, sink);
      one.pipeline->mapper().WatchSteps([this](slam::ScanStep step) { clock_.Enter(step); });
    }
  }

  // Drives until each robot has about so many further scans.
  Part Go(double scans) {
    part_ = {};
    while (static_cast<double>(part_.scan_ms.size()) < scans * static_cast<double>(robots_.size())) Step();
    return std::exchange(part_, {});
  }

  [[nodiscard]] std::size_t keyframes() const {
    std::size_t keyframes = 0;
    for (const auto& robot : robots_) keyframes += robot->pipeline->mapper().keyframe_count();
    return keyframes;
  }
  [[nodiscard]] std::uint64_t hash() const { return hash_; }

 private:
  struct Robot {
    std::unique_ptr<slam::ScanPipeline> pipeline;
    std::deque<StampedPose> truth;
  };

  void Step() {
    sim::FleetRecord next = fleet_.Next();
    Robot& robot = *robots_[static_cast<std::size_t>(next.robot)];
    if (auto* odometry = std::get_if<Odometry>(&next.record)) {
      clock_.Skip();
      return robot.pipeline->Add(*odometry);
    }
    auto scan = std::make_shared<const Scan>(std::get<Scan>(std::move(next.record)));
    for (const StampedPose& pose : fleet_.TakeTruth(next.robot)) robot.truth.push_back(pose);
    clock_.Skip();
    robot.pipeline->Add(std::move(scan));
    // A server publishes the map about as often.
    if (++scans_ % 10 == 0) static_cast<void>(robot.pipeline->mapper().TakeGridChange());
    if (scans_ % 500 == 0) part_.heap_mib = std::max(part_.heap_mib, HeapMib());
  }

  void Take(Robot& robot, const slam::ScanOutcome& outcome) {
    const StepTimes steps = clock_.Take();
    part_.scan_ms.push_back(std::accumulate(steps.begin(), steps.end(), 0.0));
    for (std::size_t k = 0; k < steps.size(); ++k) part_.step_ms[k] += steps[k];
    part_.not_localized += outcome.localized ? 0 : 1;
    const Pose2& pose = outcome.T_map_robot;
    // The estimator may answer later, when it knows the odometry.
    while (!robot.truth.empty() && robot.truth.front().stamp < outcome.stamp) robot.truth.pop_front();
    if (!robot.truth.empty() && robot.truth.front().stamp == outcome.stamp)
      part_.AddError((pose.translation() - robot.truth.front().T_map_robot.translation()).norm());
    hash_ = Mixed(Mixed(Mixed(hash_, pose.x), pose.y), pose.theta);
  }

  sim::Fleet fleet_;
  std::vector<std::unique_ptr<Robot>> robots_;
  StepClock clock_;
  Part part_;
  std::uint64_t hash_ = 0xcbf29ce484222325U;
  std::uint64_t scans_ = 0;
};

// One figure in each hour, and how much larger it may be in the last hour than in the second.
struct Course {
  const char* name;
  const char* unit;
  double most_ratio;
  std::vector<double> values;
};

void Compare(const std::string& who, std::vector<Course> courses, double part_h, Report& report) {
  for (Course& course : courses) {
    Plot plot{.title = who + ": " + course.name, .x = {"time", "h"}, .y = {course.name, course.unit}};
    Series series;
    for (std::size_t i = 0; i < course.values.size(); ++i) series.x.push_back(part_h * static_cast<double>(i + 1));
    series.y = course.values;
    plot.series = {series};
    report.Add(plot, who + " " + course.name);
    if (course.values.size() < 3) continue;
    const double ratio = course.values.back() / course.values[1];
    const std::string text = std::string(course.name) + " in the last hour is " + Number(ratio, 2) +
                             " times that in the second (at most " + Number(course.most_ratio, 1) + ")";
    report.Text(text);
    report.Expect(ratio <= course.most_ratio, who + ": " + text);
  }
}

void DriveFor(double hours, int robots, const std::string& who, StudyContext& context) {
  Report& report = context.report;
  const double part_h = std::min(1.0, hours / 2.0);
  Drive drive(robots, context.seed);
  std::vector<std::string> columns = {"hours",         "mean (ms)",       "p99 (ms)",       "max (ms)",
                                      "keyframes",     "most heap (MiB)", "resident (MiB)", "error rms (m)",
                                      "error max (m)", "not localized"};
  for (const std::string_view step : slam::kScanStepNames) columns.push_back(std::string(step) + " (ms)");
  columns.emplace_back("poses");
  Table table(columns);
  Course mean{"mean time of a scan", "ms", 1.2, {}}, p99{"p99 of the time of a scan", "ms", 1.2, {}},
      heap{"memory", "MiB", 1.3, {}};
  for (double hour = part_h; hour < hours + 0.5 * part_h; hour += part_h) {
    const Part part = drive.Go(part_h * 36000.0);
    const auto scans = static_cast<double>(part.scan_ms.size());
    const Distribution scan_ms = DistributionOf(part.scan_ms);
    mean.values.push_back(scan_ms.mean);
    p99.values.push_back(scan_ms.p99);
    heap.values.push_back(part.heap_mib);
    std::vector<std::string> row = {Number(hour, 2),
                                    Number(scan_ms.mean, 3),
                                    Number(scan_ms.p99, 2),
                                    Number(scan_ms.max, 1),
                                    Count(static_cast<long long>(drive.keyframes())),
                                    Number(part.heap_mib, 1),
                                    Number(ResidentMibOf(getpid()), 1),
                                    Number(std::sqrt(part.squared_error_m2 / scans), 3),
                                    Number(part.largest_error_m, 3),
                                    Count(part.not_localized)};
    for (const double step_ms : part.step_ms) row.push_back(Number(step_ms / scans, 3));
    row.push_back(std::to_string(drive.hash()));
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) line += (k > 0 ? ", " : "") + columns[k] + " " + row[k];
    report.Progress(line);
    table.Add(std::move(row));
  }
  report.Add(table, who);
  Compare(who, {std::move(mean), std::move(p99), std::move(heap)}, part_h, report);
}

void RunLifelong(StudyContext& context) {
  const auto hours = [&](double full) { return context.hours > 0.0 ? context.hours : context.Pick(full, 0.05); };
  if (context.Wants("one robot")) {
    context.report.Heading("One robot drives: 10 scans of 360 beams a second");
    DriveFor(hours(24.0), 1, "one robot", context);
  }
  if (context.Wants("eight robots")) {
    context.report.Heading("Eight robots drive, each with a map of its own");
    DriveFor(hours(6.0), 8, "eight robots", context);
  }
}

const Registration kLifelong("lifelong", "a day of robots in one building: time of a scan and memory in each hour",
                             RunLifelong);

}  // namespace
}  // namespace cairn::studies
