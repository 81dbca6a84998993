#include "server/tools/calibrate/command_line.h"

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>

#include "common/file/atomic_file.h"
#include "common/options/config.h"
#include "common/sensor/log_options.h"
#include "common/version.h"
#include "server/tools/calibrate/laser_run.h"
#include "server/tools/calibrate/motion_run.h"
#include "server/tools/calibrate/odometry_run.h"
#include "server/tools/log_run/json_line.h"
#include "server/tools/log_run/server_sections.h"

namespace cairn::server {
namespace {

struct Shared {
  std::ostream& out;
  std::ostream& err;
  bool json = false;
  std::function<int()> action;

  int Refuse(const Status& status, int exit_code) {
    if (json) out << ErrorJson(status);
    err << "cairn-calibrate: " << status.message << '\n';
    return exit_code;
  }
};

template <typename Report>
int Show(Shared& shared, const Result<Report>& report) {
  if (!report) return shared.Refuse(report.error(), 1);
  shared.out << (shared.json ? ReportJson(*report) : ReportText(*report));
  return 0;
}

void AddOdometry(CLI::App& app, Shared& shared) {
  auto* command = app.add_subcommand("odometry", "Wheel errors of a differential drive from square runs (UMBmark)");
  command->footer(
      "RUNS is a text file: `#` comments, then the line\n"
      "  direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta\n"
      "and one line for each run: the direction (cw or ccw), the floor (smooth or bumps), and the robot's end pose,\n"
      "first as measured from outside, then according to its odometry, in metres and radians, relative to its start\n"
      "with the first side along x. Runs in both directions are needed; five of each are usual. Without RUNS,\n"
      "--simulate drives runs with injected errors.\n"
      "EXAMPLES\n  cairn-calibrate odometry runs.csv --base 0.34 --side 4\n"
      "  cairn-calibrate odometry --simulate --set run.E_d=1.01 --set run.E_b=0.98 --set run.bumps=10 --json");
  auto options = std::make_shared<OdometryRunOptions>();
  auto assignments = std::make_shared<std::vector<std::string>>();
  auto* runs = command->add_option("RUNS", options->runs, "File of runs");
  command->add_flag("--simulate", options->simulate, "Drive simulated runs instead")->excludes(runs);
  command->add_option("--runs", options->simulated_runs, "Number of simulated runs in each direction")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Random seed of the simulated runs")->capture_default_str();
  command->add_option("--side", options->square.side_m, "Side of the square (m)")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--base", options->square.drive.base_m, "Wheel base that the odometry assumes (m)")
      ->check(CLI::Range(0.01, 10.0))
      ->capture_default_str();
  command
      ->add_option("--left-diameter", options->square.drive.left_diameter_m,
                   "Diameter of the left wheel that the odometry assumes (m)")
      ->check(CLI::Range(0.001, 10.0))
      ->capture_default_str();
  command
      ->add_option("--right-diameter", options->square.drive.right_diameter_m,
                   "Diameter of the right wheel that the odometry assumes (m)")
      ->check(CLI::Range(0.001, 10.0))
      ->capture_default_str();
  command
      ->add_option("--set", *assignments, "run.KEY=VALUE of the simulation: E_d, E_b, slip_m_per_sqrt_m, bumps, bump_m")
      ->allow_extra_args(false);
  command->callback([&shared, options, assignments] {
    shared.action = [&shared, options, assignments] {
      const auto applied = ApplySet(*assignments, [&](OptionVisitor& visitor) {
        visitor.Section("run", "The simulated runs.", [&] { slam::Visit(visitor, options->run); });
      });
      if (!applied) return shared.Refuse(applied.error(), 2);
      if (options->runs.empty() && !options->simulate)
        return shared.Refuse({StatusCode::kInvalidArgument, "odometry: a file of runs, or --simulate, is needed"}, 2);
      if (!assignments->empty() && !options->simulate)
        return shared.Refuse({StatusCode::kInvalidArgument, "odometry: --set is for --simulate"}, 2);
      return Show(shared, RunOdometry(*options));
    };
  });
}

Result<void> WriteConfig(const MotionReport& report, bool with_odometry, const std::filesystem::path& path) {
  const auto yaml = ReportConfig(report, with_odometry);
  if (!yaml) return tl::unexpected(yaml.error());
  return WriteFileAtomically(path, *yaml);
}

void AddMotion(CLI::App& app, Shared& shared) {
  auto* command =
      app.add_subcommand("motion", "Motion models of a robot from its log: Eliazar's, and the scan matcher's");
  command->footer(
      "A step ends when the odometry has moved by slam.gate.distance_m or turned by slam.gate.turn_rad. The learnt\n"
      "parameters hold for steps of about that size. The scan matcher's errors are measured against --truth; without\n"
      "it, against the whole path of the estimator itself. Of the table: mean_d and sigma_d are per metre driven, "
      "mean_b\n"
      "and sigma_b per radian turned, as mean and standard deviation; failures are steps that the matcher could not\n"
      "match, shortfalls such as it measured far too short.\n"
      "EXAMPLES\n  cairn-calibrate motion intel.clf --json\n  cairn-calibrate motion robot1.log --truth robot1.tum\n"
      "  cairn-calibrate motion intel.clf --set slam.matcher=ndt_de --set fit.particles=200\n"
      "  cairn-calibrate motion intel.clf -o learnt.yaml && cairn-offline intel.clf --config learnt.yaml "
      "--set slam.filter=dpslam");
  auto options = std::make_shared<MotionRunOptions>();
  auto assignments = std::make_shared<std::vector<std::string>>();
  auto config = std::make_shared<std::filesystem::path>();
  auto seed = std::make_shared<std::optional<std::int64_t>>();
  auto learnt = std::make_shared<std::filesystem::path>();
  command->add_option("LOG", options->log, "CARMEN or DP-SLAM log, bag of ROS 2, or recording")->required();
  command->add_option("--truth", options->truth, "True poses (TUM)");
  auto* no_matcher =
      command->add_flag("!--no-matcher", options->matcher_model, "Do not learn the scan matcher's model");
  command
      ->add_option("-o,--options", *learnt,
                   "Also write the learnt options as YAML, for --config of cairn-offline and cairnd")
      ->excludes(no_matcher);
  command->add_option("--seed", *seed, "Random seed; same as --set fit.seed=N --set slam.seed=N")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option("--threads", options->threads,
                   "Number of threads; 0: one per core. The output does not depend on it")
      ->check(CLI::Range(0, 256));
  command->add_option("--max-steps", options->max_steps, "Use at most this many steps of the log; 0: all")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--config", *config, "YAML file; its slam section is used (cairnd's file will do)");
  command->add_option("--set", *assignments, "key=value, e.g. slam.gate.distance_m=0.5, fit.particles=200; repeatable")
      ->allow_extra_args(false);
  command->callback([&shared, options, assignments, config, seed, learnt] {
    shared.action = [&shared, options, assignments, config, seed, learnt] {
      const VisitOptions visit = [&](OptionVisitor& visitor) {
        visitor.Section("slam", "The estimator.", [&] { slam::Visit(visitor, options->slam); });
        visitor.Section("fit", "Expectation maximisation.", [&] { slam::Visit(visitor, options->fit); });
        IgnoreServerSections(visitor);
      };
      if (*seed) {
        assignments->push_back("fit.seed=" + std::to_string(**seed));
        assignments->push_back("slam.seed=" + std::to_string(**seed));
      }
      if (!config->empty())
        if (const auto applied = ApplyYamlFile(*config, visit); !applied) return shared.Refuse(applied.error(), 1);
      if (const auto applied = ApplySet(*assignments, visit); !applied) return shared.Refuse(applied.error(), 2);
      if (const auto valid = Validate(options->slam); !valid) return shared.Refuse(valid.error(), 2);
      const Result<MotionReport> report = RunMotion(*options);
      if (report && !learnt->empty())
        if (const auto written = WriteConfig(*report, options->slam.front_end.use_odometry, *learnt); !written)
          return shared.Refuse(written.error(), 1);
      return Show(shared, report);
    };
  });
}

void AddLaser(CLI::App& app, Shared& shared) {
  auto* command = app.add_subcommand(
      "laser", "What nobody knows of a new robot: lag, turn and mounting of its lidar, errors of its wheels");
  command->footer(
      "Every value comes with its doubt (one standard deviation). What the log does not show is said, and is left as "
      "it\n"
      "is. A log that shows all: a room with corners, in which the robot drives straight ahead, turns on the spot to\n"
      "both sides at different speeds, and stops now and then, for some minutes. What the log or the options say of\n"
      "the lidar's turn is not used.\n"
      "EXAMPLES\n  cairn-calibrate laser robot1.log\n"
      "  cairn-calibrate laser robot1.log -o robot.yaml   # then, with the options that it prints:\n"
      "  cairn-offline robot1.log --config robot.yaml --scan-period 0.18 --stamp-at last --clockwise --turn-from 0");
  auto options = std::make_shared<LaserRunOptions>();
  auto learnt = std::make_shared<std::filesystem::path>();
  command->add_option("LOG", options->log, "CARMEN or DP-SLAM log, bag of ROS 2, or recording")->required();
  command->add_option("-o,--options", *learnt,
                      "Also write lag and wheels as YAML, for --config of cairn-offline and cairnd");
  command->add_option("--pairs", options->fit.pairs_along, "Pairs of scans along the way")
      ->check(CLI::Range(20, 100000))
      ->capture_default_str();
  command->add_option("--turning-pairs", options->fit.pairs_turning, "Pairs of scans of unequal turns")
      ->check(CLI::Range(10, 100000))
      ->capture_default_str();
  command->add_option("--widest-lag", options->fit.widest_lag_s, "Largest lag that is looked for (s)")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
  command->add_option("--seed", options->fit.seed, "Random seed of the doubts")->capture_default_str();
  command
      ->add_option("--threads", options->threads,
                   "Number of threads; 0: one per core. The output does not depend on it")
      ->check(CLI::Range(0, 256));
  AddLogOptions(*command, options->reader);
  command->callback([&shared, options, learnt] {
    shared.action = [&shared, options, learnt] {
      const Result<LaserReport> report = RunLaser(*options);
      if (report && !learnt->empty()) {
        const auto yaml = ReportConfig(*report);
        const auto written = yaml ? WriteFileAtomically(*learnt, *yaml) : tl::unexpected(yaml.error());
        if (!written) return shared.Refuse(written.error(), 1);
      }
      return Show(shared, report);
    };
  });
}

}  // namespace

int RunCalibrate(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err) {
  Shared shared{out, err, false, {}};
  CLI::App app("Calibrates odometry and learns motion models, without a server.", "cairn-calibrate");
  app.set_version_flag("--version", std::string("cairn-calibrate ") + kVersion);
  app.footer(
      "`cairn-calibrate COMMAND --help` tells more.\n"
      "Exit codes: 0 done, 1 failed (one line on standard error says why), 2 wrong command line.");
  app.fallthrough();
  app.require_subcommand(1);
  app.add_flag("--json", shared.json, "One JSON object on standard output");
  AddOdometry(app, shared);
  AddMotion(app, shared);
  AddLaser(app, shared);
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));  // CLI11 takes them from the back.
  } catch (const CLI::ParseError& error) {
    return app.exit(error, out, err) == 0 ? 0 : 2;
  }
  return shared.action();
}

}  // namespace cairn::server
