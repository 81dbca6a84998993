// cairn-study joining measures a live server from outside while eight simulated robots drive through one storey of 100
// x 60 m. None of them says where it starts: after which way each is joined with the map of the first one, what this
// costs the streams, and how far the paths are from the truth afterwards. Times are wall-clock times, so no other
// program should run on the machine.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>

#include "common/sensor/trajectory.h"
#include "tests/must.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/joining/shared_way.h"
#include "tests/studies/study.h"
#include "tests/temp_directory.h"

namespace cairn::studies {
namespace {

using nlohmann::json;
using test::Must;

constexpr int kRobots = 8;
constexpr double kMostWayM = 60.0;      // Of a robot, until it is joined.
constexpr double kMostErrorM = 0.05;    // Mean over all robots, after a smoothing job.
constexpr double kMostPauseMs = 100.0;  // From scan to pose.
const char* const kSite = "storey";

struct Robot {
  std::string name;
  Trajectory truth;
  std::optional<Stamp> joined;  // The first pose that was localized.
};

double WayUntil(const Trajectory& truth, Stamp stamp) {
  double way_m = 0.0;
  for (std::size_t i = 1; i < truth.size() && truth[i].stamp <= stamp; ++i)
    way_m += (truth[i].T_map_robot.translation() - truth[i - 1].T_map_robot.translation()).norm();
  return way_m;
}

// Where a robot was and where it truly was, at the same stamps: one column each.
struct Places {
  Eigen::Matrix2Xd estimate, truth;
};

Places PlacesOf(const Trajectory& path, const Trajectory& truth) {
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs;
  for (const StampedPose& pose : path) {
    const auto at = std::ranges::lower_bound(truth, pose.stamp, {}, &StampedPose::stamp);
    if (at != truth.end() && at->stamp == pose.stamp)
      pairs.emplace_back(pose.T_map_robot.translation(), at->T_map_robot.translation());
  }
  Places places{Eigen::Matrix2Xd(2, pairs.size()), Eigen::Matrix2Xd(2, pairs.size())};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    places.estimate.col(static_cast<Eigen::Index>(i)) = pairs[i].first;
    places.truth.col(static_cast<Eigen::Index>(i)) = pairs[i].second;
  }
  return places;
}

struct Errors {
  std::vector<double> mean_m, max_m;  // By robot; NaN: it has no path.
  double all_mean_m = 0.0;
};

// The rigid motion that moves the points nearest to the others. Source: Umeyama, PAMI 1991, in the plane, without
// scale.
Pose2 BestFit(const Eigen::Matrix2Xd& points, const Eigen::Matrix2Xd& others) {
  const Eigen::Vector2d mean = points.rowwise().mean(), mean_others = others.rowwise().mean();
  double along = 0.0, across = 0.0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector2d a = points.col(i) - mean, b = others.col(i) - mean_others;
    along += a.dot(b);
    across += a.x() * b.y() - a.y() * b.x();
  }
  const Pose2 turn{0.0, 0.0, std::atan2(across, along)};
  const Eigen::Vector2d offset = mean_others - turn * mean;
  return {offset.x(), offset.y(), turn.theta};
}

// After all paths together were moved as one rigid body to where they fit the truth best: their frame is that of the
// first robot.
Errors ErrorsOf(const std::vector<Trajectory>& paths, const std::vector<Robot>& robots) {
  std::vector<Places> places;
  Eigen::Index count = 0;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    places.push_back(PlacesOf(paths[i], robots[i].truth));
    count += places.back().estimate.cols();
  }
  Eigen::Matrix2Xd estimate(2, count), truth(2, count);
  Eigen::Index next = 0;
  for (const Places& one : places) {
    estimate.middleCols(next, one.estimate.cols()) = one.estimate;
    truth.middleCols(next, one.truth.cols()) = one.truth;
    next += one.estimate.cols();
  }
  if (count < 2) throw std::runtime_error("no pose could be compared with the truth");
  const Pose2 T_truth_estimate = BestFit(estimate, truth);
  Errors errors{.mean_m = {}, .max_m = {}, .all_mean_m = 0.0};
  for (const Places& one : places) {
    Eigen::Matrix2Xd moved = one.estimate;
    for (Eigen::Index i = 0; i < moved.cols(); ++i) moved.col(i) = T_truth_estimate * Eigen::Vector2d(moved.col(i));
    const Eigen::VectorXd distance = (moved - one.truth).colwise().norm();
    errors.mean_m.push_back(distance.size() > 0 ? distance.mean() : std::nan(""));
    errors.max_m.push_back(distance.size() > 0 ? distance.maxCoeff() : std::nan(""));
    errors.all_mean_m += distance.sum() / static_cast<double>(count);
  }
  return errors;
}

std::vector<Trajectory> PathsOf(LiveServer& server, const std::vector<Robot>& robots, bool smoothed) {
  std::vector<Trajectory> paths;
  for (const Robot& robot : robots) {
    auto path = server.queries().Path(robot.name, smoothed);
    paths.push_back(path ? std::move(path->poses) : Trajectory{});
  }
  return paths;
}

double SecondsOf(const Job& job) {
  return SecondsFromStamp(job.ended - job.started);
}

void RunFleet(StudyContext& context, bool see_each_other) {
  Report& report = context.report;
  const std::string part = see_each_other ? "visible" : "unseen";
  report.Heading(see_each_other ? "Robots appear in each other's scans" : "Robots do not appear in each other's scans");
  const int seconds = context.seconds > 0.0 ? static_cast<int>(context.seconds) : context.Pick(240, 20);
  const TempDirectory directory;
  LiveServer server;
  std::vector<std::string> sim_arguments = {"sim",
                                            "--site",
                                            kSite,
                                            "--world",
                                            "storey",
                                            "--robots",
                                            std::to_string(kRobots),
                                            "--unknown-starts",
                                            "--seconds",
                                            std::to_string(seconds),
                                            "--seed",
                                            std::to_string(context.seed),
                                            "--truth-dir",
                                            directory.path().string(),
                                            "--watch-pid",
                                            server.pid()};
  if (!see_each_other) sim_arguments.emplace_back("--unseen");
  const auto fleet = server.Start(sim_arguments);
  std::map<std::string, Stamp> joined;
  std::optional<OccupancyImage> before_join, after_join;
  while (fleet->RunningAfter(std::chrono::milliseconds(200))) {
    const auto states = server.queries().Robots();
    if (!states) continue;
    for (const RobotStatus& robot : *states)
      if (robot.pose.localized) joined.try_emplace(robot.session.robot, robot.pose.stamp);
    if (after_join) continue;
    if (auto map = server.queries().MapImage(kSite)) (joined.size() < 2 ? before_join : after_join) = *std::move(map);
  }
  const json sim = PrintedBy(fleet->Wait(LiveServer::kDeadline));
  std::vector<Job> jobs = Must(server.queries().Jobs(kSite));
  std::erase_if(jobs, [](const Job& job) { return !IsFinal(job.state); });
  double longest_s = 0.0, all_s = 0.0;
  for (const Job& job : jobs) {
    longest_s = std::max(longest_s, SecondsOf(job));
    all_s += SecondsOf(job);
  }

  std::vector<Robot> robots;
  for (int i = 1; i <= kRobots; ++i) {
    Robot robot{.name = "robot" + std::to_string(i), .truth = {}, .joined = {}};
    robot.truth = Must(ReadTum(directory.path() / (robot.name + ".tum")));
    if (const auto at = joined.find(robot.name); at != joined.end()) robot.joined = at->second;
    robots.push_back(std::move(robot));
  }
  std::vector<Trajectory> known = PathsOf(server, robots, false);
  for (std::size_t i = 0; i < robots.size(); ++i) {  // Before that, a pose is relative to the robot's own start.
    std::erase_if(known[i],
                  [&](const StampedPose& pose) { return !robots[i].joined || pose.stamp < *robots[i].joined; });
  }
  const Errors live = ErrorsOf(known, robots);
  const Job smooth = Must(server.queries().WaitForJob(Must(server.queries().SubmitJob(kSite, JobKind::kSmooth)).id));
  report.Expect(smooth.state == JobState::kSucceeded, "the smoothing job: " + smooth.message);
  const std::vector<Trajectory> paths = PathsOf(server, robots, true);
  const Errors after = ErrorsOf(paths, robots);

  std::vector<Trajectory> truths;
  for (const Robot& robot : robots) truths.push_back(robot.truth);
  const std::vector<SharedWay> shared = SharedWays(truths);
  Table table({"robot", "way driven (m)", "until it meets the map (m)", "until it shares 15 m of it (m)",
               "way until joined (m)", "later than shared (m)", "online after that, mean (m)", "smoothed, mean (m)",
               "smoothed, max (m)"});
  Plot plot{.title = "eight robots, starts unknown, " + part, .x = {"x", "m"}, .y = {"y", "m"}};
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const Robot& robot = robots[i];
    const double way_m = robot.joined ? WayUntil(robot.truth, *robot.joined) : -1.0;
    table.Add({robot.name, Number(WayUntil(robot.truth, robot.truth.back().stamp), 1),
               i == 0 ? "-" : Number(shared[i].meets_m, 1), i == 0 ? "-" : Number(shared[i].shares_m, 1),
               i == 0         ? "the first"
               : robot.joined ? Number(way_m, 1)
                              : "never",
               i == 0 || !robot.joined ? "-" : Number(way_m - shared[i].shares_m, 1), Number(live.mean_m[i], 3),
               Number(after.mean_m[i], 3), Number(after.max_m[i], 3)});
    plot.series.push_back(PathSeries(paths[i], robot.name));
    if (context.quick) continue;
    report.Expect(robot.joined.has_value() && way_m <= kMostWayM, robot.name + " was not joined within 60 m");
  }
  report.Text(
      "Before a robot shares some way with robots of the map nothing can join it: `meets the map` is where it comes "
      "within 2 m of where one of them has been, as the truth has it, and `shares 15 m` where such places lie 15 m "
      "apart along the ways of both. A robot counts as one of the map as soon as it shares as much itself.");
  report.Add(table, "robots-" + part);
  Table found({"job", "begun after (s)", "took (s)", "result"});
  const Stamp first = robots.front().truth.front().stamp;
  for (const Job& job : jobs)
    found.Add({std::to_string(job.id), Number(SecondsFromStamp(job.started - first), 1), Number(SecondsOf(job), 1),
               job.message.substr(0, job.message.find(';'))});
  report.Add(found, "jobs-" + part);
  const double pause_ms = sim.at("pose_latency_max_ms");
  Table figures({"figure", "measured", "wanted"});
  figures.Add({"mean error of all smoothed paths (m)", Number(after.all_mean_m, 3), Number(kMostErrorM, 2)});
  figures.Add({"longest time from scan to pose (ms)", Number(pause_ms, 1), Number(kMostPauseMs, 0)});
  figures.Add({"scan to pose, p99 (ms)", Number(sim.at("pose_latency_p99_ms"), 1), "-"});
  figures.Add({"jobs that joined or aligned robots, and the last that did not",
               Count(static_cast<long long>(jobs.size())), "-"});
  figures.Add({"their time, the longest and all (s)", Number(longest_s, 1) + ", " + Number(all_s, 1), "-"});
  figures.Add({"the smoothing job (s)", Number(SecondsOf(smooth), 1), "-"});
  figures.Add({"server, share of a core", Percent(sim.at("watched_cpu_share")), "-"});
  report.Add(figures, "joining-" + part);
  report.Text("Smoothing job: " + smooth.message);
  const Plot bare{.title = "before the first join, " + part, .x = plot.x, .y = plot.y};
  if (before_join) report.AddMap(*before_join, bare, "before-the-first-join-" + part);
  if (after_join) {
    Plot after_plot = bare;
    after_plot.title = "after the first join, " + part;
    report.AddMap(*after_join, after_plot, "after-the-first-join-" + part);
  }
  report.AddMap(Must(server.queries().MapImage(kSite)), plot, "joined-map-" + part);
  if (context.quick) return;
  report.Expect(after.all_mean_m <= kMostErrorM, "the smoothed paths are too far from the truth");
  report.Expect(pause_ms <= kMostPauseMs, "a pose came too late");
}

void RunJoining(StudyContext& context) {
  for (const bool see_each_other : {false, true})
    if (context.Wants(see_each_other ? "visible" : "unseen")) RunFleet(context, see_each_other);
}

const Registration kRegistered{"joining", "eight robots in one building, starts unknown, on a live server", RunJoining};

}  // namespace
}  // namespace cairn::studies
