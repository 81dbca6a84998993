// cairn-study kills ends cairnd with SIGKILL a thousand times while robots drive, and compares the results with those
// of a server that is not killed; also while somebody gives orders. Then it measures the processor time that the store
// needs. Times are wall-clock times, so no other program should run on the machine.
#include <algorithm>
#include <future>
#include <optional>

#include "tests/studies/fleet/live_server.h"
#include "tests/studies/kills/restart.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"
#include "tests/system/killed_fleet.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

constexpr double kLongestRestart_s = 2.0;
constexpr double kLongestQuickRestart_s = 15.0;
constexpr double kMostCost = 0.10;
constexpr double kLeastCpu_s = 60.0;  // Shorter measurements differ by as much as the store costs.

double At(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

void Add(test::KilledFleetOutcome& all, const test::KilledFleetOutcome& one) {
  all.kills += one.kills;
  all.killed_starting += one.killed_starting;
  all.sent += one.sent;
  all.lost += one.lost;
  all.doubled += one.doubled;
  all.poses += one.poses;
  all.wrongly_localized += one.wrongly_localized;
  all.beside_truth += one.beside_truth;
  all.undisturbed_poses += one.undisturbed_poses;
  all.undisturbed_beside_truth += one.undisturbed_beside_truth;
  all.farthest_m = std::max(all.farthest_m, one.farthest_m);
  all.undisturbed_farthest_m = std::max(all.undisturbed_farthest_m, one.undisturbed_farthest_m);
  all.paths_that_differ += one.paths_that_differ;
  all.orders.jobs += one.orders.jobs;
  all.orders.ended += one.orders.ended;
  all.orders.given_up += one.orders.given_up;
  all.orders.switches += one.orders.switches;
  all.orders.checks += one.orders.checks;
  all.orders.broken.insert(all.orders.broken.end(), one.orders.broken.begin(), one.orders.broken.end());
  all.ready_s.insert(all.ready_s.end(), one.ready_s.begin(), one.ready_s.end());
  all.tracking_s.insert(all.tracking_s.end(), one.tracking_s.begin(), one.tracking_s.end());
}

// Until there were so many kills. Returns nothing where none was possible.
std::optional<test::KilledFleetOutcome> Kill(StudyContext& context, int wanted, bool orders) {
  test::KilledFleetOutcome all;
  for (std::uint64_t round = 0; all.kills < wanted; ++round) {
    const TempDirectory directory;
    test::KilledFleetOptions options;
    options.cairnd = ProgramPath("cairnd");
    options.cairn = ProgramPath("cairn");
    options.directory = directory.path();
    options.robots = 4;
    options.seconds = context.Pick(180.0, 40.0);
    options.kills = wanted - all.kills;
    options.seed = context.seed + round;
    options.orders = orders;
    const test::KilledFleetOutcome one = test::RunKilledFleet(options);
    if (one.kills == 0) {
      context.report.Fault("no kill was possible");
      return std::nullopt;
    }
    Add(all, one);
    for (const std::string& difference : one.differences) context.report.Progress(difference);
    for (const std::string& broken : one.orders.broken) context.report.Progress(broken);
    context.report.Progress(Count(all.kills) + " kills, " + Count(static_cast<long long>(all.lost)) + " scans lost");
  }
  return all;
}

std::string Share(std::uint64_t part, std::uint64_t whole) {
  return Percent(static_cast<double>(part) / static_cast<double>(std::max<std::uint64_t>(1, whole)));
}

// The two servers do not tell the same poses, so the shares may differ by one in a thousand.
void ExpectNoMoreBesideTheTruth(Report& report, const test::KilledFleetOutcome& all, const std::string& without) {
  const auto share = [](std::uint64_t part, std::uint64_t whole) {
    return static_cast<double>(part) / static_cast<double>(std::max<std::uint64_t>(1, whole));
  };
  report.Expect(
      share(all.beside_truth, all.poses) <= share(all.undisturbed_beside_truth, all.undisturbed_poses) + 0.001,
      "more poses are beside the truth than without " + without);
}

void StudyKills(StudyContext& context) {
  const auto outcome = Kill(context, context.runs > 0 ? context.runs : context.Pick(1000, 20), false);
  if (!outcome) return;
  const test::KilledFleetOutcome& all = *outcome;
  Report& report = context.report;
  report.Heading("SIGKILL under four robots");
  Table table({"kills", "of these while starting", "scans sent", "lost", "doubled", "poses told", "wrongly localized",
               "paths that differ", "answers after p50 (s)", "p99 (s)", "all robots have poses after p50 (s)",
               "p99 (s)"});
  table.Add({Count(all.kills), Count(all.killed_starting), Count(static_cast<long long>(all.sent)),
             Count(static_cast<long long>(all.lost)), Count(static_cast<long long>(all.doubled)),
             Count(static_cast<long long>(all.poses)), Count(static_cast<long long>(all.wrongly_localized)),
             Count(all.paths_that_differ), Number(At(all.ready_s, 0.5), 2), Number(At(all.ready_s, 0.99), 2),
             Number(At(all.tracking_s, 0.5), 2), Number(At(all.tracking_s, 0.99), 2)});
  report.Add(table, "kills");
  report.Text(
      "Wrongly localized: more than 0.5 m or 0.5 rad beside the pose of an undisturbed server at the same time. The "
      "truth is farther away than that in " +
      Share(all.beside_truth, all.poses) + " of the poses, and in " +
      Share(all.undisturbed_beside_truth, all.undisturbed_poses) + " of those of the undisturbed server.");
  report.Expect(all.lost == 0 && all.doubled == 0, "scans were lost or used twice");
  report.Expect(all.wrongly_localized == 0, "a robot was localized at a wrong place");
  report.Expect(all.paths_that_differ == 0, "paths differ from those of an undisturbed server");
  ExpectNoMoreBesideTheTruth(report, all, "kills");
}

void StudyOrders(StudyContext& context) {
  const auto outcome = Kill(context, context.runs > 0 ? context.runs : context.Pick(200, 10), true);
  if (!outcome) return;
  const test::KilledFleetOutcome& all = *outcome;
  Report& report = context.report;
  report.Heading("SIGKILL while paths are smoothed and the map is switched");
  Table table({"kills", "jobs", "of these ended", "given up", "switches of the map", "checks", "broken promises",
               "scans sent", "lost", "doubled", "poses told", "beside the truth", "at most (m)",
               "beside it undisturbed and without orders", "at most (m)"});
  const auto broken = static_cast<long long>(all.orders.broken.size());
  table.Add({Count(all.kills), Count(all.orders.jobs), Count(all.orders.ended), Count(all.orders.given_up),
             Count(all.orders.switches), Count(all.orders.checks), Count(broken),
             Count(static_cast<long long>(all.sent)), Count(static_cast<long long>(all.lost)),
             Count(static_cast<long long>(all.doubled)), Count(static_cast<long long>(all.poses)),
             Share(all.beside_truth, all.poses), Number(all.farthest_m, 2),
             Share(all.undisturbed_beside_truth, all.undisturbed_poses), Number(all.undisturbed_farthest_m, 2)});
  report.Add(table, "orders");
  report.Text(
      "Jobs and switches whose order was answered. A job is given up when eight servers have died while it ran. Beside "
      "the truth: poses called localized and more than 0.5 m or "
      "0.5 rad away from it.");
  report.Expect(broken == 0, "what was answered did not hold after a start");
  // Smoothing makes the map better; kills and switches must not make it worse than it is without both.
  ExpectNoMoreBesideTheTruth(report, all, "kills and orders");
  report.Expect(all.orders.ended == all.orders.jobs, "jobs did not end well");
  report.Expect(all.orders.given_up <= all.kills / 8, "jobs were given up too early");
  report.Expect(all.lost == 0 && all.doubled == 0, "scans were lost or used twice");
}

struct Cost {
  double cpu_s = 0.0;
  double scans = 0.0;      // Used by the estimators. A busy machine drops some.
  std::string store_line;  // What the server logs about its store at the end.

  Cost& operator+=(const Cost& other) {
    cpu_s += other.cpu_s;
    scans += other.scans;
    return *this;
  }
};

Cost CostOf(const std::string& state, int domain_number, int seconds) {
  const std::string domain = std::to_string(domain_number);
  ChildProcess server({ProgramPath("cairnd"), "--domain", domain, "--state", state});
  if (!server.Says(" ready")) throw std::runtime_error("cairnd does not start: " + server.Wait().output);
  const double before = CpuSecondsOf(server.pid());
  ChildProcess fleet({ProgramPath("cairn"), "sim", "--site", "cost", "--robots", "8", "--beams", "360", "--hz", "10",
                      "--world", "building", "--seconds", std::to_string(seconds), "--domain", domain, "--json"});
  const nlohmann::json printed = PrintedBy(fleet.Wait(LiveServer::kDeadline));
  Cost cost;
  cost.cpu_s = CpuSecondsOf(server.pid()) - before;
  for (const auto& robot : printed.at("robots")) cost.scans += robot.at("used").get<double>();
  server.Signal(SIGTERM);
  const std::string output = server.Wait().output;
  if (const auto found = output.find("store: ", output.find(" ready")); found != std::string::npos)
    cost.store_line = output.substr(found, output.find('\n', found) - found);
  return cost;
}

void StudyCost(StudyContext& context) {
  Report& report = context.report;
  report.Heading("What being durable costs: eight robots at 10 Hz, 360 beams");
  const int seconds = context.seconds > 0.0 ? static_cast<int>(context.seconds) : context.Pick(240, 10);
  // Two servers that do the same differ by up to 3 % in one round.
  const int rounds = context.Pick(3, 1);
  Table table({"round", "state", "processor time (s)", "scans used", "of a scan (ms)", "more", "store"});
  const auto of_scan = [](const Cost& cost) { return cost.cpu_s / cost.scans; };
  const auto more = [&](const Cost& with, const Cost& without) { return of_scan(with) / of_scan(without) - 1.0; };
  Cost all_with, all_without;
  for (int round = 1; round <= rounds; ++round) {
    const TempDirectory directory;
    // At the same time, because what a scan costs on this machine differs by more from one minute to the next.
    auto beside = std::async(std::launch::async, CostOf, "none", test::AnotherTestDomain(), seconds);
    const Cost with = CostOf((directory / "state").string(), test::TestDomain(), seconds);
    const Cost without = beside.get();
    const auto add = [&](const char* state, const Cost& cost, const std::string& percent) {
      table.Add({Count(round), state, Number(cost.cpu_s, 2), Number(cost.scans, 0), Number(1e3 * of_scan(cost), 3),
                 percent, cost.store_line.empty() ? "-" : cost.store_line});
    };
    add("none", without, "-");
    add("on disk", with, Percent(more(with, without)));
    all_with += with;
    all_without += without;
  }
  report.Add(table, "cost");
  const double all_more = more(all_with, all_without);
  report.Text("Being durable costs " + Percent(all_more) + " more processor time for each scan, over all rounds.");
  report.Expect(context.quick || all_more <= kMostCost, "being durable costs more than " + Percent(kMostCost));
  report.Expect(context.quick || std::min(all_with.cpu_s, all_without.cpu_s) >= kLeastCpu_s,
                "less than " + Number(kLeastCpu_s, 0) + " s of processor time: run it for longer (--seconds)");
}

void StudyRestart(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Restart with eight robots of an hour each");
  const RestartTimes times = MeasureRestarts(context);
  Table table({"kills", "state (MB)", "tiles answered after p50 (s)", "p99 (s)", "last poses answered after p50 (s)",
               "p99 (s)", "all connected robots have new poses after p50 (s)", "p99 (s)", "new sessions"});
  table.Add({Count(static_cast<long long>(times.tiles_s.size())),
             Number(static_cast<double>(times.state_bytes) / 1e6, 0), Number(At(times.tiles_s, 0.5), 2),
             Number(At(times.tiles_s, 0.99), 2), Number(At(times.poses_s, 0.5), 2), Number(At(times.poses_s, 0.99), 2),
             Number(At(times.new_poses_s, 0.5), 2), Number(At(times.new_poses_s, 0.99), 2), Count(times.new_sessions)});
  report.Add(table, "restart");
  Plot plot{
      .title = "Restart with eight robots of an hour each", .x = {.label = "kill"}, .y = {"time since the kill", "s"}};
  const auto add = [&plot](const char* label, const std::vector<double>& times_s) {
    Series series{.label = label, .mark = Mark::kPoints};
    for (std::size_t kill = 0; kill < times_s.size(); ++kill) series.x.push_back(static_cast<double>(kill + 1));
    series.y = times_s;
    plot.series.push_back(std::move(series));
  };
  add("tiles", times.tiles_s);
  add("new poses of all robots", times.new_poses_s);
  plot.bounds.push_back({kLongestRestart_s, "target"});
  report.Add(plot, "restart");
  report.Text(
      "Since the kill, with the pause of 0.1 s after which the service manager starts the server again. The robots are "
      "eight clients in this process, which continue their sessions and "
      "drive back and forth over the last half minute of their logs; a new pose is one of a scan that was made after "
      "the kill.");
  // A quick run is a test beside other tests, of logs that are too short for a checkpoint.
  const double longest_s = context.quick ? kLongestQuickRestart_s : kLongestRestart_s;
  report.Expect(At(times.poses_s, 0.99) <= longest_s, "a restart takes more than " + Number(longest_s, 0) + " s");
  report.Expect(At(times.new_poses_s, 0.99) <= longest_s,
                "robots wait more than " + Number(longest_s, 0) + " s for their new poses");
  report.Expect(times.new_sessions == 0, "the server did not know sessions that it had stored");
}

void StudyAll(StudyContext& context) {
  if (context.Wants("kills")) StudyKills(context);
  if (context.Wants("orders")) StudyOrders(context);
  if (context.Wants("cost")) StudyCost(context);
  if (context.Wants("restart")) StudyRestart(context);
}

const Registration kKills("kills", "SIGKILL a thousand times under robots that drive, and the cost of being durable",
                          StudyAll);

}  // namespace
}  // namespace cairn::studies
