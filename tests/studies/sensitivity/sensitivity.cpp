// cairn-study sensitivity: what halving and doubling each constant of the estimator does to the error, on
// every log and in four simulated worlds. Goes on where it ended: runs are kept in the report's folder.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "tests/studies/sensitivity/run_cache.h"
#include "tests/studies/sensitivity/self_check_replay.h"
#include "tests/studies/sensitivity/verdict.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr std::array<int, 2> kDirections = {-1, 1};  // Halved, doubled.
constexpr int kOtherSeeds = 4;
constexpr std::array<double, 2> kNudges = {0.99, 1.01};
constexpr std::array<Runs, 6> kAllRuns = {Runs::kUsual,  Runs::kRolling,  Runs::kSelfCheck,
                                          Runs::kDpSlam, Runs::kNdtAlone, Runs::kLoops};

std::string KindOf(Runs runs) {
  constexpr std::array<const char*, 7> kNames = {"usual", "loops", "dpslam", "ndt", "rolling", "moved", "self_check"};
  return kNames[static_cast<std::size_t>(runs)];
}

std::string ValueText(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

// The value a constant gets, without changing anything else.
double ValueOf(const Constant& constant, int direction) {
  slam::MapperOptions options;
  return constant.change(options, direction);
}

class Sensitivity {
 public:
  explicit Sensitivity(StudyContext& context)
      : context_(context),
        cache_(context.report.directory().empty() ? std::filesystem::path() : context.report.directory() / "runs.tsv"),
        constants_(AllConstants()) {}

  void Run() {
    for (const Runs runs : kAllRuns) {
      std::vector<Constant> wanted;
      for (const Constant& constant : constants_)
        if (constant.runs == runs && context_.Wants(constant.name)) wanted.push_back(constant);
      if (wanted.empty()) continue;
      if (runs == Runs::kSelfCheck)
        RunSelfCheck(wanted);
      else
        RunDrives(runs, wanted);
    }
  }

 private:
  struct Row {
    std::string name;
    std::array<Effect, 2> effects;  // Halved, doubled.
    [[nodiscard]] bool measured() const { return !effects[0].groups.empty() || !effects[1].groups.empty(); }
  };

  // The figures that `measure` returns, unless they were measured before. With --log, only these logs are run; the
  // others show what is known, if anything (no figures).
  template <typename Measure>
  Figures Once(const Case& one, const std::string& what, const Measure& measure) {
    const std::string key = KindOf(one.runs) + " | " + one.name + " | " + what;
    if (const Figures* known = cache_.Find(key)) return *known;
    const auto is_this = [&](const std::filesystem::path& log) { return log.stem() == one.log.name; };
    if (!context_.logs.empty() && std::none_of(context_.logs.begin(), context_.logs.end(), is_this)) return {};
    const Figures figures = measure();
    cache_.Keep(key, figures);
    std::string text = key + ":";
    for (const auto& [name, value] : figures) text += " " + name + " " + Number(value, 4);
    context_.report.Progress(text);
    return figures;
  }

  void RunDrives(Runs runs, const std::vector<Constant>& constants) {
    std::vector<Row> rows(constants.size());
    std::set<std::string> groups;
    Table usual_table({"log", "figure", "default", "largest ratio of seeds and nudges"});
    for (const Case& one : CasesOf(context_, runs)) {
      groups.insert(one.group);
      const auto run = [&](const std::string& what, const slam::MapperOptions& options) {
        return Once(one, what, [&] { return MeasureRun(one, options); });
      };
      const Figures usual = run("default", one.options);
      SeedNoise noise;
      for (int seed = 1; seed <= kOtherSeeds; ++seed) {
        slam::MapperOptions options = one.options;
        options.seed += seed;
        AddNoise(usual, run("seed " + Count(options.seed), options), noise);
      }
      // On some drives the smallest difference in the front-end changes the result, and a seed changes only the filter.
      for (const double nudge : kNudges) {
        slam::MapperOptions options = one.options;
        options.front_end.refine.residual_sigma_m *= nudge;
        AddNoise(usual, run("nudged by " + ValueText(nudge), options), noise);
      }
      for (const auto& [name, value] : usual)
        usual_table.Add({one.name, name, Number(value, 4), Number(std::exp(noise[name]), 2)});
      for (std::size_t i = 0; i < constants.size(); ++i) {
        rows[i].name = constants[i].name;
        for (std::size_t d = 0; d < kDirections.size(); ++d) {
          slam::MapperOptions options = one.options;
          const double value = constants[i].change(options, kDirections[d]);
          const Figures changed = run(constants[i].name + " = " + ValueText(value), options);
          AddEffect(one.group, one.name, usual, changed, noise, rows[i].effects[d]);
        }
      }
    }
    context_.report.Heading("Runs: " + KindOf(runs));
    context_.report.Add(usual_table, "default_" + KindOf(runs));
    ShowRows(runs, constants, rows, {groups.begin(), groups.end()});
  }

  void ShowRows(Runs runs, const std::vector<Constant>& constants, const std::vector<Row>& rows,
                const std::vector<std::string>& groups) {
    std::vector<std::string> header{"row", "constant", "default", "halved, doubled"};
    header.insert(header.end(), groups.begin(), groups.end());
    header.insert(header.end(), {"verdict", "largest change"});
    Table table(header);
    HeatMap map{.title = "Error over the default's, as a power of two: " + KindOf(runs),
                .x = {"of each log group, in the table's order: halved, doubled", ""},
                .y = {"row of the table", ""},
                .value_label = "log2 of the ratio",
                .low = -1.0,
                .high = 1.0,
                .print_values = true,
                .height = 120 + 22 * static_cast<int>(rows.size())};
    for (std::size_t c = 0; c < 2 * groups.size(); ++c) map.columns.push_back(0.5 * static_cast<double>(c));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const Row& row = rows[i];
      if (!row.measured()) continue;
      map.rows.push_back(static_cast<double>(i));
      std::vector<std::string> cells{Count(static_cast<long long>(i)), row.name, ValueText(ValueOf(constants[i], 0)),
                                     ValueText(ValueOf(constants[i], -1)) + ", " + ValueText(ValueOf(constants[i], 1))};
      for (const std::string& group : groups) {
        std::string cell;
        for (const Effect& effect : row.effects) {
          const auto found = effect.groups.find(group);
          const double ratio =
              found == effect.groups.end() ? std::numeric_limits<double>::quiet_NaN() : found->second.value;
          map.values.push_back(std::clamp(std::log2(ratio), -5.0, 5.0));
          cell += (cell.empty() ? "" : " / ") + Number(ratio, 2);
        }
        cells.push_back(cell);
      }
      const auto& [halved, doubled] = row.effects;
      const bool matters = halved.matters || doubled.matters;
      const Effect& larger = halved.largest.size() >= doubled.largest.size() ? halved : doubled;
      cells.push_back(matters ? "matters" : "does not");
      cells.push_back(!matters ? "-"
                               : std::string(&larger == &halved ? "halved: " : "doubled: ") +
                                     Number(larger.largest.value, 2) + " on " + larger.largest.where);
      table.Add(cells);
    }
    context_.report.Add(table, "sensitivity_" + KindOf(runs));
    context_.report.Add(map, "heat_" + KindOf(runs));
  }

  void RunSelfCheck(const std::vector<Constant>& constants) {
    Table table({"constant", "value", "log", "false alarms", "noticed", "verdict"});
    for (const Case& one : CasesOf(context_, Runs::kSelfCheck)) {
      if (one.yardstick == Yardstick::kCrispness || one.yardstick == Yardstick::kOdometry) continue;
      std::optional<SelfCheckReplay> replay;  // Made when the first figure is not known yet.
      const auto measure = [&](const std::string& what, const slam::MapperOptions& options) {
        return Once(one, what, [&] {
          if (!replay) replay.emplace(one);
          return replay->Measure(options.self_check);
        });
      };
      const Figures usual = measure("default", one.options);
      const auto add = [&](const std::string& name, const std::string& value, const Figures& figures) {
        if (usual.empty() || figures.empty()) return;  // Not run.
        // Shares, not errors: a hundredth more false alarms, or a tenth less of what is noticed.
        const bool matters = figures[0].second > usual[0].second + 0.01 ||
                             std::abs(figures[1].second - usual[1].second) > 0.1 * usual[1].second + 0.01;
        table.Add({name, value, one.name, Percent(figures[0].second), Percent(figures[1].second),
                   matters ? "matters" : "does not"});
      };
      add("default", "", usual);
      for (const Constant& constant : constants) {
        for (const int direction : kDirections) {
          slam::MapperOptions options = one.options;
          const std::string value = ValueText(constant.change(options, direction));
          add(constant.name, value, measure(constant.name + " = " + value, options));
        }
      }
    }
    context_.report.Heading("Results of the self-check");
    context_.report.Add(table, "sensitivity_self_check");
  }

  StudyContext& context_;
  RunCache cache_;
  std::vector<Constant> constants_;
};

void RunSensitivity(StudyContext& context) {
  context.report.Text(
      "Each constant is halved and doubled, one at a time. A cell shows the error divided by the error "
      "with the default value, halved / doubled; for a group of several logs or figures it is the "
      "ratio farthest from 1. A constant *matters* if some figure of some log changes by more than 10 "
      "% and by more than 2 mm, and by more than it changes with four other seeds and with "
      "residual_sigma_m changed by 1 % in either direction. The error of logs with relations is the "
      "mean relation error; in simulated worlds it is the mean distance from the true positions. Small "
      "robots have no truth: their figures are the blur and the thickness of the walls, and for the "
      "corridor log the mean distance from its odometry, which is the best reference there is. Every "
      "figure is measured for the online and for the smoothed path.");
  Sensitivity(context).Run();
}

const Registration kRegistered{"sensitivity", "each constant halved and doubled: error on every log and in four worlds",
                               RunSensitivity};

}  // namespace
}  // namespace cairn::studies
