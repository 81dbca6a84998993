// cairn-study versions: two robots drive while their paths are smoothed and the map is switched five times a second,
// far more often than any person would. It measures how far their poses are from the truth, beside the same robots that
// nobody disturbs. It uses the estimators and the smoothing without a server, so that the same seed gives the same
// figures.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/trajectory.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/site/site_smoothing.h"
#include "server/slam/site_options_of.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr double kWrong_m = 0.5, kWrong_rad = 0.5;
constexpr std::size_t kMostWaitingJobs = 2, kVersions = 32;

struct Part {
  std::uint64_t made = 0;
  std::vector<Pose2> path;
  std::vector<std::uint64_t> numbers;
};
using Version = std::map<int, Part>;  // By robot.

struct Counts {
  std::uint64_t poses = 0, beside_truth = 0;  // Called localized.
  double farthest_m = 0.0;
  int switches = 0, jobs = 0;

  void operator+=(const Counts& other) {
    poses += other.poses;
    beside_truth += other.beside_truth;
    farthest_m = std::max(farthest_m, other.farthest_m);
    switches += other.switches;
    jobs += other.jobs;
  }
};

struct DriveOptions {
  std::string world;
  int robots = 2;
  double seconds = 20.0;
  std::uint64_t seed = 1;
  double order_every_s = 0.0;  // 0: no orders.
};

class VersionDrive {
 public:
  explicit VersionDrive(const DriveOptions& options) : options_(options), random_(options.seed) {
    mapper_.filter.particles = 20;
    sim::FleetOptions fleet;
    fleet.robots = options.robots;
    fleet.scan_hz = 10.0;
    fleet.laser.beams = 181;
    fleet.seed = options.seed;
    auto made = sim::Fleet::Create(*sim::OpenWorld(options.world), fleet);
    if (!made) throw std::invalid_argument(made.error().message);
    fleet_.emplace(*std::move(made));
    end_ = fleet.first_stamp + StampFromSeconds(options.seconds);
    next_order_ = fleet.first_stamp + StampFromSeconds(1.0);
    for (int i = 0; i < options.robots; ++i) {
      robots_.push_back(std::make_unique<slam::ScanPipeline>(
          mapper_, fleet_->T_map_robot_start(i), slam::SerialFor,
          slam::ScanPipeline::Sink{
              .used = [this, i](const Scan&, const slam::ScanOutcome& outcome) { Take(i, outcome); },
              .dropped = [](const Scan&, DropReason) {}}));
    }
  }

  Counts Run() {
    for (;;) {
      sim::FleetRecord record = fleet_->Next();
      const Stamp now = std::visit([](const auto& value) { return value.stamp; }, record.record);
      if (now > end_) break;
      while (options_.order_every_s > 0.0 && next_order_ <= now) Order(next_order_);
      slam::ScanPipeline& robot = *robots_[static_cast<std::size_t>(record.robot)];
      if (const auto* odometry = std::get_if<Odometry>(&record.record))
        robot.Add(*odometry);
      else
        robot.Add(std::make_shared<const Scan>(std::get<Scan>(std::move(record.record))));
    }
    return counts_;
  }

 private:
  struct Job {
    Stamp ends = 0;
    Version version;
  };

  void Take(int robot, const slam::ScanOutcome& outcome) {
    if (!outcome.localized) return;
    const Trajectory& truth = fleet_->truth(robot);
    const auto at = std::ranges::lower_bound(truth, outcome.stamp, {}, &StampedPose::stamp);
    if (at == truth.end() || at->stamp != outcome.stamp) return;
    ++counts_.poses;
    const double away_m = (outcome.T_map_robot.translation() - at->T_map_robot.translation()).norm();
    counts_.farthest_m = std::max(counts_.farthest_m, away_m);
    if (away_m > kWrong_m || std::abs(AngleDiff(outcome.T_map_robot.theta, at->T_map_robot.theta)) > kWrong_rad)
      ++counts_.beside_truth;
  }

  void Order(Stamp now) {
    std::uniform_real_distribution<double> pause_s(0.0, 2.0 * options_.order_every_s);
    next_order_ = now + StampFromSeconds(pause_s(random_));
    for (auto job = waiting_.begin(); job != waiting_.end() && job->ends <= now; job = waiting_.erase(job)) {
      versions_[next_version_++] = std::move(job->version);
      while (versions_.size() > kVersions) {
        auto oldest = std::next(versions_.begin());
        if (oldest->first == enabled_) ++oldest;
        versions_.erase(oldest);
      }
    }
    if (std::bernoulli_distribution(0.5)(random_)) {
      Submit(now);
    } else {
      Switch();
    }
  }

  void Submit(Stamp now) {
    if (waiting_.size() >= kMostWaitingJobs) return;
    std::vector<slam::MapperSnapshot> snapshots;
    for (const auto& robot : robots_) snapshots.push_back(robot->mapper().Snapshot());
    if (snapshots.front().keyframes.empty()) return;
    std::vector<slam::SiteSession> sessions;
    for (const slam::MapperSnapshot& snapshot : snapshots) sessions.push_back({snapshot, true});
    const auto smoothed =
        slam::SmoothSessions(sessions, slam::SiteOptionsOf(mapper_), [](double /*share*/) { return true; });
    Job job;
    const Stamp begins = std::max(now, waiting_.empty() ? now : waiting_.back().ends);
    job.ends = begins + StampFromSeconds(std::uniform_real_distribution<double>(0.2, 2.0)(random_));
    for (int i = 0; i < options_.robots; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const slam::SmoothedSession& session = (*smoothed)[at];
      job.version[i] = {snapshots[at].made(), session.joined ? session.path : slam::SmoothedPath(snapshots[at]),
                        snapshots[at].numbers};
    }
    waiting_.push_back(std::move(job));
    ++counts_.jobs;
  }

  void Switch() {
    std::vector<std::uint32_t> choice;
    for (const auto& [number, version] : versions_)
      if (number != enabled_) choice.push_back(number);
    if (enabled_ != 1 && !versions_.contains(1)) choice.push_back(1);
    if (choice.empty()) return;
    const std::uint32_t wanted = choice[std::uniform_int_distribution<std::size_t>(0, choice.size() - 1)(random_)];
    const Version version = versions_[wanted];
    Version displaced;
    for (const auto& [i, part] : version) {
      slam::Mapper& mapper = robots_[static_cast<std::size_t>(i)]->mapper();
      displaced[i] = {mapper.keyframes_made(), mapper.BestPath(), mapper.keyframe_numbers()};
      static_cast<void>(
          mapper.AdoptGrid(slam::OccupancyGrid(mapper.grid().options()), part.made, part.path, part.numbers));
    }
    versions_[enabled_] = std::move(displaced);
    enabled_ = wanted;
    ++counts_.switches;
  }

  const DriveOptions options_;
  std::mt19937_64 random_;
  slam::MapperOptions mapper_;
  std::optional<sim::Fleet> fleet_;
  Stamp end_ = 0, next_order_ = 0;
  std::vector<std::unique_ptr<slam::ScanPipeline>> robots_;
  std::map<std::uint32_t, Version> versions_{{1, {}}};
  std::uint32_t enabled_ = 1, next_version_ = 2;
  std::vector<Job> waiting_;
  Counts counts_;
};

void StudyVersions(StudyContext& context) {
  Report& report = context.report;
  Table table({"world", "seed", "jobs", "switches", "poses", "beside the truth", "at most (m)", "beside it undisturbed",
               "at most (m)"});
  const int runs = context.runs > 0 ? context.runs : context.Pick(20, 2);
  // By which switches may bring a robot farther from the truth: the farther, the longer it drives.
  const double most_more_m = context.Pick(0.4, 0.2);
  const double seconds = context.seconds > 0.0 ? context.seconds : context.Pick(30.0, 15.0);
  const auto share = [](const Counts& counts) {
    return Percent(static_cast<double>(counts.beside_truth) /
                   static_cast<double>(std::max<std::uint64_t>(1, counts.poses)));
  };
  for (const std::string world : {"office", "building"}) {
    if (!context.Wants(world)) continue;
    Counts all, all_undisturbed;
    for (int run = 0; run < runs; ++run) {
      DriveOptions options{.world = world, .seconds = seconds, .seed = context.seed + static_cast<std::uint64_t>(run)};
      const Counts undisturbed = VersionDrive(options).Run();
      options.order_every_s = 0.1;
      const Counts ordered = VersionDrive(options).Run();
      table.Add({world, Count(static_cast<long long>(options.seed)), Count(ordered.jobs), Count(ordered.switches),
                 Count(static_cast<long long>(ordered.poses)), share(ordered), Number(ordered.farthest_m, 2),
                 share(undisturbed), Number(undisturbed.farthest_m, 2)});
      report.Progress(world + " " + Count(run) + ": " + share(ordered) + ", " + Number(ordered.farthest_m, 2) +
                      " m; undisturbed " + share(undisturbed) + ", " + Number(undisturbed.farthest_m, 2) + " m");
      all += ordered;
      all_undisturbed += undisturbed;
    }
    report.Expect(all.switches > 10 * runs, "there were hardly any switches: " + world);
    report.Expect(20 * all.poses > 19 * all_undisturbed.poses, "switches make robots lose their places: " + world);
    report.Expect(all.beside_truth <= all_undisturbed.beside_truth, "switches put robots beside the truth: " + world);
    report.Expect(all.farthest_m < all_undisturbed.farthest_m + most_more_m, "switches blur the poses: " + world);
    table.Add({world, "all", Count(all.jobs), Count(all.switches), Count(static_cast<long long>(all.poses)), share(all),
               Number(all.farthest_m, 2), share(all_undisturbed), Number(all_undisturbed.farthest_m, 2)});
  }
  report.Add(table, "versions");
  report.Text("Beside the truth: poses called localized and more than 0.5 m or 0.5 rad away from it.");
}

const Registration kRegistered{"versions", "poses while the map is switched again and again", StudyVersions};

}  // namespace
}  // namespace cairn::studies
