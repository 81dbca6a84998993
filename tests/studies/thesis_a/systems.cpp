#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/studies/log_run.h"
#include "tests/studies/mapper_choice.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_a/thesis_a.h"

namespace cairn::studies {
namespace {

struct Variant {
  std::string name;
  std::vector<std::string> assignments;
  std::string printed_time;   // Mean / max s of Tables 5.16, 5.17.
  std::string printed_error;  // Table 5.15: m / deg, measured differently.
};

// Each system is measured in three variants, named by these suffixes.
constexpr const char* kLinesOnly = ", lines only";
constexpr const char* kGoodSteps = ", refined steps";
constexpr const char* kAsShipped = ", as shipped";

std::vector<Variant> Variants() {
  const std::vector<std::string> pure = LinesOnly();
  // The steps are refined, and nothing but landmarks corrects them. This shows how much the landmarks help.
  const std::vector<std::string> landmarks_only{"slam.revisit.enabled=false", "slam.loop.enabled=false"};
  std::vector<Variant> variants{
      {"scan matching", {"slam.filter=none"}, "0.0497 / 0.1563", "0.83 / 3.72"},
      {"scan matching + DGL", {"slam.filter=landmark_correction"}, "0.0518 / 0.1586", "0.39 / 0.81"},
      {"FS_2LS_2LP, 200 particles",
       {"slam.filter=fastslam2_points", "slam.particles=200"},
       "0.1043 / 0.3924",
       "0.26 / 0.25"},
      {"FS_3LS_1LP, 200 particles", {"slam.filter=fastslam2_oriented", "slam.particles=200"}, "0.1069 / 0.3379", "-"}};
  const std::size_t count = variants.size();
  for (std::size_t i = 0; i < count; ++i) {
    Variant refined = variants[i];
    refined.printed_time = refined.printed_error = "";
    Variant shipped = refined;
    variants[i].name += kLinesOnly;
    variants[i].assignments.insert(variants[i].assignments.end(), pure.begin(), pure.end());
    refined.name += kGoodSteps;
    refined.assignments.insert(refined.assignments.end(), landmarks_only.begin(), landmarks_only.end());
    shipped.name += kAsShipped;
    variants.push_back(refined);
    variants.push_back(shipped);
  }
  return variants;
}

std::string ErrorText(const RelationError& error) {
  return Number(error.trans_mean_m, 3) + " / " + Number(error.rot_mean_deg, 2);
}

// Times of keyframes and of the scans between them. The thesis separates scans with and without re-observed landmarks;
// in Cairn the filter works at keyframes only.
struct Split {
  Distribution all, keyframes, others;
};

Split SplitOf(const LogRun& run) {
  std::vector<double> keyframes, others;
  std::size_t last = SIZE_MAX;
  for (std::size_t i = 0; i < run.scan_cpu_ms.size() && i < run.snapshot.scans.size(); ++i) {
    const bool is_keyframe = run.snapshot.scans[i].keyframe != last;
    last = run.snapshot.scans[i].keyframe;
    (is_keyframe ? keyframes : others).push_back(run.scan_cpu_ms[i]);
  }
  return {run.time_ms(), DistributionOf(keyframes), DistributionOf(others)};
}

void AddMaps(StudyContext& context, const StudyLog& log, const LogRun& run, const slam::MapperOptions& options,
             const std::string& name) {
  const RelationError online = ErrorOf(run.online, log.relations), full = ErrorOf(run.full, log.relations);
  for (const auto& [which, label, path, error] : {std::tuple{WhichPath::kOnline, "online", &run.online, online},
                                                  std::tuple{WhichPath::kFull, "full", &run.full, full}}) {
    Plot plot{.title = log.name + ", " + name + ", " + label + " SLAM: " + Number(error.trans_mean_m, 3) + " m, " +
                       Number(error.rot_mean_deg, 2) + " deg",
              .x = {"x", "m"},
              .y = {"y", "m"},
              .width = 1100,
              .height = 900};
    plot.series = {PathSeries(*path, label + std::string(" path"))};
    plot.series[0].colour = 2;
    context.report.AddMap(MapOf(run, which, options.grid), plot, "map_" + log.name + "_" + label);
  }
}

void StudyOneLog(StudyContext& context, const StudyLog& log) {
  Report& report = context.report;
  Table table({"system on " + log.name, "thesis mean / max (s)", "Cairn mean (s)", "p99 (s)", "max (s)",
               "between keyframes mean (s)", "keyframe mean (s)", "user CPU (s)", "thesis error (m / deg)",
               "online (m / deg)", "full (m / deg)", "not localized"});
  Plot curve{.title = "Time per scan on " + log.name + " (median of 50 scans; Figures 5.38-5.40, 5.43)",
             .x = {"scan", ""},
             .y = {"processor time", "ms", true}};
  double matching_alone_m = 0.0;  // With refined steps.
  for (const Variant& variant : Variants()) {
    const auto options = MapperWith(variant.assignments, context.seed);
    if (!options) {
      table.Add({variant.name, variant.printed_time, "not in this build"});
      continue;
    }
    const LogRun run = RunOverLog(log, *options);
    const Split split = SplitOf(run);
    const RelationError online = ErrorOf(run.online, log.relations), full = ErrorOf(run.full, log.relations);
    const auto s = [](double ms) { return Number(ms / 1e3, 5); };
    table.Add({variant.name, variant.printed_time, s(split.all.mean), s(split.all.p99), s(split.all.max),
               s(split.others.mean), s(split.keyframes.mean), Number(run.user_cpu_s, 1), variant.printed_error,
               ErrorText(online), ErrorText(full), Count(static_cast<long long>(run.not_localized))});
    if (double metres = 0, degrees = 0; std::sscanf(variant.printed_error.c_str(), "%lf / %lf", &metres, &degrees) == 2)
      if (full.trans_mean_m > metres || full.rot_mean_deg > degrees)
        report.Warn(variant.name + " on " + log.name +
                    " is worse than the figure of the thesis (other log, measured differently): " + ErrorText(full) +
                    " beside " + variant.printed_error);
    if (variant.name.ends_with(kGoodSteps)) {
      if (matching_alone_m == 0.0) {
        matching_alone_m = online.trans_mean_m;  // The first of them.
      } else if (!context.quick && !log.relations.empty()) {
        report.Expect(
            online.trans_mean_m < matching_alone_m,
            variant.name + " on " + log.name + ": the error with landmarks is not smaller than with matching alone");
      }
    }
    Series series{.label = variant.name, .mark = Mark::kLine};
    for (std::size_t i = 0; i + 50 <= run.scan_cpu_ms.size(); i += 50) {
      series.x.push_back(static_cast<double>(i));
      series.y.push_back(DistributionOf({run.scan_cpu_ms.begin() + static_cast<std::ptrdiff_t>(i),
                                         run.scan_cpu_ms.begin() + static_cast<std::ptrdiff_t>(i) + 50})
                             .median);
    }
    curve.series.push_back(series);
    if (variant.name == "FS_2LS_2LP, 200 particles, as shipped") {
      AddMaps(context, log, run, *options, "FS_2LS_2LP");
      report.Expect(run.online.size() > log.scans() * 9 / 10,
                    "on " + log.name + " at least a tenth of the scans has no pose");
      if (!log.relations.empty() && full.trans_mean_m > 0.26)
        report.Warn("on " + log.name +
                    " the error of the full path is larger than the 0.26 m that the thesis prints (for its own log, "
                    "measured differently): " +
                    Number(full.trans_mean_m, 3) + " m");
      report.Expect(log.relations.empty() || full.trans_mean_m < 1.0,
                    "on " + log.name + " the mean error of the full path is 1 m or more");
      if (split.all.max > 200.0) report.Warn("a scan took longer than 0.2 s, the limit of the thesis");
    }
  }
  report.Add(table, "systems_" + log.name);
  report.Add(curve, "time_" + log.name);
}

}  // namespace

void StudySystems(StudyContext& context, const std::vector<StudyLog>& logs) {
  context.report.Heading("Comparison of the systems (5.1-5.6, Tables 5.15-5.17, Figures 5.35-5.43)");
  context.report.Text(
      "\"Lines only\" is the system of the thesis: the answer of the voting matcher is the step, and "
      "the filter uses nothing but landmarks. \"Refined steps\" adds only the point-to-line "
      "refinement, which shows how much landmarks help when the steps are good. \"As shipped\" also "
      "adds revisits and large loops, and is the default. Times are processor time per scan with one "
      "thread. The errors of the thesis (Table 5.15) are those of six places on Jones Farms, measured "
      "in its map. The errors of Cairn are means over verified relations. The two columns are "
      "therefore measured differently and cannot be compared directly. \"Online\" is the pose that the "
      "robot was given at the time of the scan; \"full\" is the whole path of the best particle at the "
      "end (5.4). The thesis measures times of scans with and without re-observed landmarks. Cairn "
      "updates its filter at keyframes only, so this table separates keyframes from other scans "
      "instead.");
  for (const Variant& variant : Variants())
    if (const auto options = MapperWith(variant.assignments, context.seed); !options)
      context.report.Warn(variant.name + " is not in this build: " + options.error().message);
  for (const StudyLog& log : logs) StudyOneLog(context, log);
}

}  // namespace cairn::studies
