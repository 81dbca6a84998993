// Several robots of one site, smoothed together: published logs cut into parts, each a robot of its own whose start
// nobody knows. How well the parts keep the true motions, inside each and from one to another, beside the whole log as
// one robot. And worlds of equal rooms, in which no part may be joined at a wrong place.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "server/slam/grid/grid_image.h"
#include "server/slam/site/site_smoothing.h"
#include "server/slam/site_options_of.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/joint/cut_log.h"
#include "tests/studies/joint/fleets.h"
#include "tests/studies/log_run.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

struct Case {
  std::string log;
  std::size_t parts = 2;
  double most_ratio = 1.3;  // Of the error of one robot.
};

struct Joined {
  std::vector<slam::SmoothedSession> sessions;
  double cpu_s = 0.0;
};

// What a job would have known a little earlier: the keyframes before the `share` of them.
slam::MapperSnapshot FirstPart(const slam::MapperSnapshot& whole, double share) {
  slam::MapperSnapshot part = whole;
  const auto count = static_cast<std::size_t>(share * static_cast<double>(whole.keyframes.size()));
  part.keyframes.resize(count);
  if (!part.numbers.empty()) part.numbers.resize(count);
  part.online_path.resize(count);
  part.full_path.resize(count);
  std::erase_if(part.relations, [count](const auto& one) { return std::max(one.from, one.to) >= count; });
  std::erase_if(part.scans, [count](const auto& one) { return one.keyframe >= count; });
  return part;
}

Joined Smooth(const std::vector<LogRun>& runs, const std::vector<std::size_t>& order,
              const slam::MapperOptions& options) {
  std::vector<slam::SiteSession> sessions;
  for (const std::size_t i : order) sessions.push_back({runs[i].snapshot, false});
  const Stopwatch watch;
  auto smoothed = slam::SmoothSessions(sessions, SiteOptionsOf(options), [](double) { return true; });
  Joined joined{.sessions = std::vector<slam::SmoothedSession>(runs.size()), .cpu_s = watch.CpuMs() * 1e-3};
  for (std::size_t i = 0; i < order.size(); ++i) {
    joined.sessions[order[i]] = std::move((*smoothed)[i]);
    joined.sessions[order[i]].frame = order[joined.sessions[order[i]].frame];
  }
  return joined;
}

struct JobTime {
  double all_s = 0.0, drawing_s = 0.0;
  std::size_t keyframes = 0, drawn_anew = 0;  // Along both paths.
  bool all_joined = false;
};

constexpr double kMostLiveRatio = 1.2;
constexpr double kMostSecondJob = 0.1;  // Of the first one's processor time.

// What a job of the server does with them: smooths them together, and draws and compares each along both its paths.
JobTime RunJob(const std::vector<slam::MapperSnapshot>& snapshots, const slam::MapperOptions& options,
               slam::RelationBook& book, std::vector<slam::DrawnMaps>& drawings) {
  JobTime time;
  const Stopwatch watch;
  book.BeginJob();
  std::vector<slam::SiteSession> sessions;
  for (std::size_t i = 0; i < snapshots.size(); ++i) sessions.push_back({snapshots[i], false, i + 1});
  const auto smoothed = slam::SmoothSessions(
      sessions, SiteOptionsOf(options), [](double) { return true; }, slam::SiteSearch::kAll, &book);
  time.all_joined = std::ranges::all_of(*smoothed, [](const auto& session) { return session.joined; });
  const Stopwatch drawing;
  drawings.resize(snapshots.size());
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    slam::DrawnMaps& drawn = drawings[i];
    static_cast<void>(slam::MapAlong(
        snapshots[i], (*smoothed)[i].path, options.grid, [] { return true; }, &drawn));
    time.keyframes += drawn.online->keyframes.size() + drawn.smoothed->keyframes.size();
    time.drawn_anew += drawn.online->drawn_anew + drawn.smoothed->drawn_anew;
  }
  time.drawing_s = drawing.CpuMs() * 1e-3;
  time.all_s = watch.CpuMs() * 1e-3;
  return time;
}

// A job when this share of each part is driven, and a second one at its end. Whether the first has joined all.
bool RunTwoJobs(const std::vector<LogRun>& runs, const std::string& name, double share,
                const slam::MapperOptions& options, StudyContext& context, Table& table) {
  std::vector<slam::MapperSnapshot> before, now;
  before.reserve(runs.size());
  now.reserve(runs.size());
  for (const LogRun& run : runs) {
    before.push_back(FirstPart(run.snapshot, share));
    now.push_back(run.snapshot);
  }
  slam::RelationBook book;
  std::vector<slam::DrawnMaps> drawings;
  const JobTime first = RunJob(before, options, book, drawings);
  const std::size_t measured_first = book.measured();
  const JobTime second = RunJob(now, options, book, drawings);
  table.Add({name, Number(100.0 * share, 0) + " %", first.all_joined ? "all" : "not all", Number(first.all_s, 2),
             Number(second.all_s, 2), Number(second.all_s / first.all_s, 3), Number(first.drawing_s, 2),
             Number(second.drawing_s, 2), std::to_string(second.drawn_anew) + " of " + std::to_string(second.keyframes),
             std::to_string(measured_first), std::to_string(book.measured()), std::to_string(book.reused()),
             Number(1e-6 * static_cast<double>(book.BytesOf({1, 2}).size()), 2)});
  if (context.quick || !first.all_joined) return first.all_joined;
  context.report.Expect(
      second.all_s <= kMostSecondJob * first.all_s,
      name + ": a second job took " + Number(100.0 * second.all_s / first.all_s, 1) + " % of the first one");
  return true;
}

// Where the first job cannot join all yet, what the second one does is new: then the first is made later.
void RunTwoJobs(const std::vector<LogRun>& runs, const std::string& name, const slam::MapperOptions& options,
                StudyContext& context, Table& table) {
  for (const double share : {0.97, 0.98, 0.99})
    if (RunTwoJobs(runs, name, share, options, context, table)) return;
  context.report.Warn(name + ": no first job has joined all");
}

Trajectory PathOf(const std::vector<LogRun>& runs, const Joined& joined) {
  Trajectory all;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Trajectory part = runs[i].snapshot.TrajectoryAlong(joined.sessions[i].path);
    all.insert(all.end(), part.begin(), part.end());
  }
  std::ranges::stable_sort(all, {}, &StampedPose::stamp);
  return all;
}

// Relations whose two stamps lie in different parts, or in the same one.
std::vector<Relation> Across(const std::vector<LogRun>& runs, const std::vector<Relation>& relations, bool across) {
  const auto part_of = [&runs](Stamp stamp) {
    std::size_t part = 0;
    while (part + 1 < runs.size() && stamp >= runs[part + 1].online.front().stamp) ++part;
    return part;
  };
  std::vector<Relation> kept;
  std::ranges::copy_if(relations, std::back_inserter(kept),
                       [&](const Relation& one) { return (part_of(one.from) != part_of(one.to)) == across; });
  return kept;
}

OccupancyImage Draw(const std::vector<LogRun>& runs, const Joined& joined, const slam::GridOptions& options) {
  slam::OccupancyGrid grid(options);
  const std::size_t frame = joined.sessions.front().frame;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (joined.sessions[i].frame != frame) continue;
    for (std::size_t k = 0; k < joined.sessions[i].path.size(); ++k)
      if (runs[i].snapshot.keyframes[k].localized)
        grid.Draw(*runs[i].snapshot.keyframes[k].scan, joined.sessions[i].path[k]);
  }
  return slam::ImageOf(grid);
}

void RunCut(StudyContext& context, const Case& one, Table& table, Table& sessions, Table& jobs) {
  const auto log = OpenRealLog(context, one.log, context.Pick(0, 3000));
  if (!log) return;
  slam::MapperOptions options;
  options.seed = static_cast<std::int64_t>(context.seed);
  context.report.Progress(one.log + ": one robot");
  const LogRun whole = RunOverLog(*log, options);
  const double alone_m =
      ErrorOf(whole.snapshot.TrajectoryAlong(slam::SmoothedPath(whole.snapshot)), log->relations).trans_mean_m;

  const double live_m = ErrorOf(whole.snapshot.FullTrajectory(), log->relations).trans_mean_m;

  std::vector<LogRun> runs;
  for (const StudyLog& part : CutIntoParts(*log, one.parts)) {
    context.report.Progress(part.name);
    runs.push_back(RunOverLog(part, options));
  }
  RunTwoJobs(runs, one.log, options, context, jobs);
  if (!context.quick)
    context.report.Expect(
        live_m <= kMostLiveRatio * alone_m,
        one.log + ": the live path is " + Number(live_m / alone_m, 2) + " times as inexact as the smoothed one");
  std::vector<std::size_t> order(one.parts);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (const bool reversed : {false, true}) {
    if (reversed) std::ranges::reverse(order);
    const Joined joined = Smooth(runs, order, options);
    const std::size_t frame = joined.sessions.front().frame;
    const bool all = std::ranges::all_of(
        joined.sessions, [frame](const auto& session) { return session.joined && session.frame == frame; });
    const Trajectory path = PathOf(runs, joined);
    const RelationError error = ErrorOf(path, log->relations);
    const RelationError across = ErrorOf(path, Across(runs, log->relations, true));
    const RelationError inside = ErrorOf(path, Across(runs, log->relations, false));
    const std::string name = one.log + (reversed ? ", last first" : "");
    table.Add({name, std::to_string(one.parts), all ? "all" : "NOT ALL", Number(live_m, 4), Number(live_m / alone_m, 2),
               Number(alone_m, 4), Number(error.trans_mean_m, 4), Number(error.trans_mean_m / alone_m, 2),
               Number(inside.trans_mean_m, 4), Number(across.trans_mean_m, 4), std::to_string(across.compared),
               Number(error.trans_max_m, 2), Number(joined.cpu_s, 1)});
    for (std::size_t i = 0; i < runs.size(); ++i) {
      const slam::SmoothedSession& session = joined.sessions[i];
      sessions.Add({name + " " + std::to_string(i + 1), session.joined ? "yes" : "no",
                    std::to_string(session.frame + 1), std::to_string(session.relations),
                    std::to_string(session.withdrawn), Number(session.agreement, 3)});
    }
    Plot plot{.title = name + ", " + std::to_string(one.parts) + " robots", .x = {"x", "m"}, .y = {"y", "m"}};
    for (std::size_t i = 0; i < runs.size(); ++i)
      if (joined.sessions[i].frame == frame)
        plot.series.push_back(
            PathSeries(runs[i].snapshot.TrajectoryAlong(joined.sessions[i].path), "robot " + std::to_string(i + 1)));
    context.report.AddMap(Draw(runs, joined, options.grid), plot, "joint-" + name);
    if (context.quick) continue;
    context.report.Expect(all, name + ": not all robots were joined");
    context.report.Expect(error.trans_mean_m <= one.most_ratio * alone_m, name + ": the joint path is too inexact");
  }
}

// Worlds in which some places look alike, and worlds in which none do.
void RunFleets(StudyContext& context) {
  Table table({"world", "by", "runs", "robots joined", "at a wrong place", "mean error (m)", "largest error (m)",
               "largest error (rad)"});
  const int runs = context.runs > 0 ? context.runs : context.Pick(20, 2);
  for (const ConsistencyDrive& drive : ConsistencyDrives(context.seconds > 0.0 ? context.seconds : 150.0)) {
    if (!context.Wants(drive.world.name)) continue;
    FleetJoin together, fragments;
    const auto add = [](FleetJoin& all, const FleetJoin& one) {
      all.robots += one.robots;
      all.error_m += one.error_m * (one.joined - one.wrong);
      all.joined += one.joined;
      all.wrong += one.wrong;
      all.most_m = std::max(all.most_m, one.most_m);
      all.most_rad = std::max(all.most_rad, one.most_rad);
    };
    for (int run = 0; run < runs; ++run) {
      slam::MapperOptions options;
      options.filter.particles = 50;
      const std::uint64_t seed = context.seed + static_cast<std::uint64_t>(run);
      options.seed = static_cast<std::int64_t>(seed);
      const FleetJoins one = JoinFleet(drive, options, seed);
      add(together, one.together);
      add(fragments, one.fragments);
      if (one.together.wrong + one.fragments.wrong > 0)
        context.report.Warn(drive.world.name + ", seed " + std::to_string(seed) + ": wrongly joined");
    }
    for (const auto& [how, all] : {std::pair{"smoothing job", together}, std::pair{"join job", fragments}})
      table.Add({drive.world.name, how, std::to_string(runs),
                 std::to_string(all.joined) + " of " + std::to_string(all.robots), std::to_string(all.wrong),
                 Number(all.error_m / std::max(1, all.joined - all.wrong), 3), Number(all.most_m, 3),
                 Number(all.most_rad, 3)});
    context.report.Expect(together.wrong + fragments.wrong == 0,
                          drive.world.name + ": robots were joined at wrong places");
  }
  context.report.Add(table, "fleets");
}

void RunJoint(StudyContext& context) {
  context.report.Text(
      "Logs are cut into parts of equal numbers of scans; each part is a robot whose start is unknown. Then all are "
      "smoothed together. `one robot`: the error of the whole log, smoothed; `live`: of its path as it is known at the "
      "end of the log without a job (to be within 1.2 times the smoothed one). `inside` and `across`: relations within "
      "one part, and between two.");
  Table table({"log", "robots", "joined", "one robot live (m)", "live / smoothed", "one robot (m)", "joint (m)",
               "ratio", "inside (m)", "across (m)", "relations across", "max (m)", "processor time (s)"});
  Table jobs({"log", "driven before", "joined by the first", "first job (s)", "second (s)", "ratio",
              "first, drawing (s)", "second, drawing (s)", "drawn anew by the second", "measured",
              "measured by the second", "used again", "MB of the first pair"});
  Table sessions({"robot", "joined", "frame of", "relations", "withdrawn", "agreement"});
  for (const Case& one : {Case{"intel", 3, 1.15}, Case{"mit-csail", 2, 1.3}, Case{"mit-killian", 2, 1.3}})
    if (context.Wants(one.log)) RunCut(context, one, table, sessions, jobs);
  context.report.Add(table, "joint");
  context.report.Add(sessions, "sessions");
  context.report.Text(
      "A job when 97 % of each part is driven, and a second one at its end, which knows what the first has measured "
      "(RelationBook) and drawn (DrawnMap: keyframes along both paths; only those that have moved are drawn anew). "
      "Both with the drawing of the maps, processor time. Where the first cannot join all yet, the second does so for "
      "the first time, and a later first job follows (98 %, 99 %).");
  context.report.Add(jobs, "jobs");
  context.report.Text(
      "Three simulated robots, starts unknown, a hundred metres of way each, joined by a smoothing job, or by a job "
      "that looks for them in the map that the first one has begun. `at a wrong place`: on the average more than 0.5 m "
      "or 0.1 rad from the true one, seen from the others where these have been. The largest errors are those of the "
      "worst robot that is joined, wrong ones too.");
  RunFleets(context);
}

const Registration kRegistered{"joint", "several robots of one site, smoothed together", RunJoint};

}  // namespace
}  // namespace cairn::studies
