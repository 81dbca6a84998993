// cairn-study moved follows robots that nobody watched for a while: how many poses are called localized at a wrong
// place, how many robots are found again, and after which time and way. --only constants: the same with each constant
// of the recovery halved and doubled. --only elsewhere: robots carried to where only others have mapped (elsewhere.h).
// --only kidnapped: robots carried between two scans, which nothing but their scans shows.
#include <algorithm>
#include <map>

#include "tests/server/slam/moved_sweep.h"
#include "tests/studies/moved/elsewhere.h"
#include "tests/studies/sensitivity/constants.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

struct Tally {
  int cases = 0, poses = 0, wrong = 0;
  double worst_m = 0.0;
  std::vector<double> found_s, found_m;
};

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

void AddTo(Tally& tally, const test::MovedCase& one) {
  ++tally.cases;
  tally.poses += one.poses;
  tally.wrong += one.wrong;
  tally.worst_m = std::max(tally.worst_m, one.worst_m);
  if (one.found_after_s < 0.0) return;
  tally.found_s.push_back(one.found_after_s);
  tally.found_m.push_back(one.found_after_m);
}

void AddTable(Report& report, const std::map<std::string, Tally>& tallies, const std::string& by) {
  Table table({by, "cases", "poses", "wrong", "largest error (m)", "found again", "after p50 (s)", "p90 (s)", "p50 (m)",
               "p90 (m)"});
  for (const auto& [name, tally] : tallies)
    table.Add({name, Count(tally.cases), Count(tally.poses), Count(tally.wrong), Number(tally.worst_m, 2),
               Percent(static_cast<double>(tally.found_s.size()) / tally.cases),
               Number(Quantile(tally.found_s, 0.5), 1), Number(Quantile(tally.found_s, 0.9), 1),
               Number(Quantile(tally.found_m, 0.5), 1), Number(Quantile(tally.found_m, 0.9), 1)});
  report.Add(table, "moved by " + by);
}

// One moment of each drive, all kinds, one seed; half a minute after it.
Tally TallyWith(const StudyContext& context, const slam::MapperOptions& mapper) {
  Tally tally;
  test::MovedSweepOptions options;
  options.moments = 1;
  options.watched_again_s = 30.0;
  options.seed = context.seed;
  options.mapper = mapper;
  options.done = [&tally](const test::MovedCase& one) { AddTo(tally, one); };
  if (context.quick) options.worlds = {"room"};
  static_cast<void>(test::RunMovedSweep(options));
  return tally;
}

void StudyConstants(StudyContext& context) {
  Table table({"constant", "value", "wrong", "largest error (m)", "found again", "after p50 (s)", "p90 (s)"});
  const auto add = [&](const std::string& name, const std::string& value, const slam::MapperOptions& mapper) {
    const Tally tally = TallyWith(context, mapper);
    const std::vector<std::string> row{name,
                                       value,
                                       Count(tally.wrong),
                                       Number(tally.worst_m, 2),
                                       Percent(static_cast<double>(tally.found_s.size()) / tally.cases),
                                       Number(Quantile(tally.found_s, 0.5), 1),
                                       Number(Quantile(tally.found_s, 0.9), 1)};
    std::string line;
    for (const std::string& cell : row) line += cell + " ";
    context.report.Progress(line);
    table.Add(row);
  };
  add("default", "", {});
  for (const Constant& constant : RecoveryConstants()) {
    for (const int direction : {-1, 1}) {
      slam::MapperOptions mapper;
      const double value = constant.change(mapper, direction);
      add(constant.name, Number(value, 3), mapper);
    }
  }
  context.report.Add(table, "moved constants");
}

// The robots of one row of the table of kidnapped robots.
struct Kidnapped {
  // `shown`: robots that drive far enough where their own map shows them.
  int cases = 0, in_time = 0, shown = 0, found = 0, wrong = 0, wrong_later = 0;
  std::vector<double> noticed_m, found_m;

  void Add(const test::MovedCase& one) {
    constexpr double kFarEnoughM = 10.0;
    ++cases;
    wrong += one.wrong;
    wrong_later += one.wrong_later;
    in_time += one.wrong_later == 0 ? 1 : 0;
    if (one.noticed_after_m >= 0.0) noticed_m.push_back(one.noticed_after_m);
    if (one.shown_m < kFarEnoughM) return;
    ++shown;
    if (one.found_after_m < 0.0 || one.wrong_later > 0) return;
    ++found;
    found_m.push_back(one.found_after_m);
  }
  [[nodiscard]] double Share(int count, int of) const { return static_cast<double>(count) / std::max(of, 1); }
};

void StudyKidnapped(StudyContext& context) {
  constexpr double kLeastFound = 0.95;
  constexpr double kLeastInTime = 0.96;  // In a corridor of equal rooms nothing shows where the robot is.
  Report& report = context.report;
  report.Heading("Kidnapped");
  report.Text(
      "Robots that are carried along their way between two scans. Nothing is missing, and their odometry stands "
      "still meanwhile. A robot is noticed at its first pose that is not localized; in time: no pose after more than " +
      Number(test::kNoticedWithinM, 0) +
      " m of way is called localized at a wrong place. Of those that drive at least 10 m of their later way where they "
      "drove before, found again: localized at the end, and never at a wrong place. Wrong: poses that are called "
      "localized at a wrong place, and those of them that are not in time.");
  std::map<std::string, Kidnapped> rows;
  Kidnapped all;
  test::MovedSweepOptions options;
  options.kidnapped = true;
  options.moments = context.Pick(9, 1);
  options.between_s = 25.0;
  options.done = [&](const test::MovedCase& one) {
    rows[one.world + ", " + one.kind].Add(one);
    all.Add(one);
    if (one.wrong_later > 0 || one.found_after_m < 0.0)
      report.Progress(one.world + ", " + one.kind + ", at " + Number(one.from_s, 0) + " s, seed " +
                      Count(static_cast<long long>(one.seed)) + ": " + Count(one.wrong_later) +
                      " wrong later, noticed after " + Number(one.noticed_after_m, 1) + " m, found after " +
                      Number(one.found_after_m, 1) + " m, own map " + Number(one.shown_m, 1) + " m");
  };
  const int seeds = context.runs > 0 ? context.runs : 1;
  for (int k = 0; k < seeds; ++k) {
    options.seed = context.seed + static_cast<std::uint64_t>(k);
    static_cast<void>(test::RunMovedSweep(options));
    report.Progress(Count(all.cases) + " robots, " + Count(all.wrong_later) +
                    " wrong poses after they could be noticed");
  }
  Table table({"world, carried", "robots", "in time", "noticed after p50 (m)", "p90 (m)", "in their own map",
               "found again", "after p50 (m)", "p90 (m)", "wrong", "wrong later"});
  const auto add = [&table](const std::string& name, const Kidnapped& row) {
    table.Add({name, Count(row.cases), Percent(row.Share(row.in_time, row.cases)),
               Number(Quantile(row.noticed_m, 0.5), 1), Number(Quantile(row.noticed_m, 0.9), 1), Count(row.shown),
               Percent(row.Share(row.found, row.shown)), Number(Quantile(row.found_m, 0.5), 1),
               Number(Quantile(row.found_m, 0.9), 1), Count(row.wrong), Count(row.wrong_later)});
  };
  for (const auto& [name, row] : rows) add(name, row);
  add("all", all);
  report.Add(table, "kidnapped");
  const std::string late = Count(all.cases - all.in_time) + " of " + Count(all.cases) + " robots";
  if (all.in_time < all.cases) report.Warn(late + " were localized at a wrong place; none is wanted");
  report.Expect(all.Share(all.in_time, all.cases) >= kLeastInTime, late + ": more were localized at a wrong place");
  report.Expect(all.Share(all.found, all.shown) >= kLeastFound, "fewer robots than wanted were found again");
}

void StudyMoved(StudyContext& context) {
  if (context.only == "kidnapped") return StudyKidnapped(context);
  if (context.only == "constants") return StudyConstants(context);
  if (context.only == "elsewhere") return StudyElsewhere(context);
  Report& report = context.report;
  std::map<std::string, Tally> by_kind, by_world, all;
  bool stood_still = true;
  test::MovedSweepOptions options;
  options.only = context.only;
  options.moments = context.Pick(3, 1);
  options.done = [&](const test::MovedCase& one) {
    AddTo(by_kind[one.kind], one);
    AddTo(by_world[one.world], one);
    AddTo(all["all"], one);
    stood_still = stood_still && (!one.stood_still || one.found_after_s >= 0.0);
    if (one.wrong > 0)
      report.Progress(Count(one.wrong) + " wrong, up to " + Number(one.worst_m, 1) + " m: " + one.world + ", " +
                      one.kind + ", at " + Number(one.from_s, 0) + " s, seed " +
                      Count(static_cast<long long>(one.seed)));
  };
  const int seeds = context.runs > 0 ? context.runs : context.Pick(5, 1);
  for (int k = 0; k < seeds; ++k) {
    options.seed = context.seed + static_cast<std::uint64_t>(k);
    static_cast<void>(test::RunMovedSweep(options));
  }
  AddTable(report, by_kind, "kind");
  AddTable(report, by_world, "world");
  AddTable(report, all, "sum");
  report.Expect(all["all"].wrong == 0, "a robot was localized at a wrong place");
  report.Expect(2 * all["all"].found_s.size() > static_cast<std::size_t>(all["all"].cases),
                "fewer than half of the robots were found again");
  report.Expect(stood_still, "a robot that stood still was lost");
  if (!context.only.empty()) return;
  StudyKidnapped(context);
  StudyElsewhere(context);
}

const Registration kRegistered{"moved", "robots that nobody watched for a while: never localized at a wrong place",
                               StudyMoved};

}  // namespace
}  // namespace cairn::studies
