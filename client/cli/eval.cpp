#include <memory>
#include <string>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "client/cli/trajectory_crispness.h"
#include "client/cli/trajectory_error.h"
#include "common/sensor/log_options.h"

namespace cairn::client {
namespace {

struct EvalArguments {
  std::vector<std::string> files;
  std::string align = "none";
  double max_rmse_m = 0.0;
  std::string log;  // Of --map-entropy; empty: the error against the truth is asked for.
  CrispnessOptions crispness;
  LogReaderOptions reader = {.all_lidars = true};
};

ExitCode CompareWithTruth(Program& program, const EvalArguments& arguments) {
  if (arguments.files.size() != 2) {
    program.err() << "cairn eval: give an estimate and the truth, or --map-entropy LOG\n";
    return ExitCode::kUsage;
  }
  const auto estimate = ReadTum(arguments.files[0]);
  if (!estimate) return program.Refuse(estimate.error());
  const auto truth = ReadTum(arguments.files[1]);
  if (!truth) return program.Refuse(truth.error());
  const auto error =
      CompareTrajectories(*estimate, *truth, arguments.align == "se2" ? Alignment::kSe2 : Alignment::kNone);
  if (!error) return program.Refuse(error.error());
  program.Print(FormatTrajectoryError(*error), *error);
  const bool within = arguments.max_rmse_m == 0.0 || error->rmse_m <= arguments.max_rmse_m;
  return within ? ExitCode::kOk : ExitCode::kFailed;
}

ExitCode CompareCrispness(Program& program, const EvalArguments& arguments) {
  std::vector<NamedCrispness> rows;
  const auto measure = [&](const std::string& name, const Result<Trajectory>& trajectory) -> Result<void> {
    if (!trajectory) return tl::unexpected(trajectory.error());
    const auto crispness = MeasureCrispness(arguments.log, arguments.reader, *trajectory, arguments.crispness);
    if (!crispness) return tl::unexpected(Status{crispness.error().code, name + ": " + crispness.error().message});
    rows.push_back({name, *crispness});
    return {};
  };
  Result<void> measured;
  for (std::size_t i = 0; measured && i < arguments.files.size(); ++i)
    measured = measure(arguments.files[i], ReadTum(arguments.files[i]));
  if (arguments.files.empty()) measured = measure("odometry", ReadOdometry(arguments.log, arguments.reader));
  if (!measured) return program.Refuse(measured.error());
  return program.Print(FormatCrispness(rows), {{"log", arguments.log},
                                               {"radius_m", arguments.crispness.entropy.radius_m},
                                               {"spacing_m", arguments.crispness.spacing_m},
                                               {"trajectories", rows}});
}

ExitCode Evaluate(Program& program, const EvalArguments& arguments) {
  return arguments.log.empty() ? CompareWithTruth(program, arguments) : CompareCrispness(program, arguments);
}

}  // namespace

void AddEval(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("eval", "Error of a trajectory, or how crisp a map it makes; needs no server");
  command->footer(
      "With two TUM files, an estimate and the truth, prints the absolute trajectory error (ATE): how far the\n"
      "estimate is from the truth at each stamp of the estimate. The truth is interpolated between its poses.\n"
      "Where there is no truth, --map-entropy puts the scans of a log down along each trajectory, or along the\n"
      "odometry in the log, and prints how crisp the map is: the mean map entropy (lower is crisper) and the median\n"
      "thickness of walls. Compare trajectories of one log only, and look at the map too (`cairn map draw`): a wall\n"
      "that is drawn twice, farther apart than --radius, is not seen.\n"
      "EXAMPLES\n  cairn eval robot1.tum truth/robot1.tum\n  cairn eval a.tum b.tum --align se2 --max-rmse 0.1\n"
      "  cairn eval --map-entropy run.log\n  cairn eval --map-entropy run.log live.tum smoothed.tum");
  auto arguments = std::make_shared<EvalArguments>();
  command
      ->add_option("files", arguments->files,
                   "TUM files: estimate and truth; with --map-entropy the trajectories to compare [the odometry of the "
                   "log]")
      ->type_name("FILE");
  auto* align = command->add_option("--align", arguments->align, "Move the estimate to fit best before comparing")
                    ->check(CLI::IsMember({"none", "se2"}))
                    ->capture_default_str();
  auto* max_rmse = command->add_option("--max-rmse", arguments->max_rmse_m, "Exit code 1 where the ATE is larger")
                       ->check(Positive())
                       ->type_name("METRES");
  auto* log = command
                  ->add_option("--map-entropy", arguments->log,
                               "How crisp the map of this log or bag is; the options below say how to read it")
                  ->type_name("LOG")
                  ->excludes(align)
                  ->excludes(max_rmse);
  AddNumber(*command, "--radius", arguments->crispness.entropy.radius_m, 0.01, 5.0,
            "How far around a place its points are taken", "METRES")
      ->needs(log);
  AddNumber(*command, "--spacing", arguments->crispness.spacing_m, 0.001, 1.0,
            "One point is kept per square of this size", "METRES")
      ->needs(log);
  command->add_option("--max-range", arguments->crispness.max_range_m, "Leave out hits farther away")
      ->check(Positive())
      ->type_name("METRES")
      ->needs(log);
  AddLogOptions(*command, arguments->reader);
  program.OnChosen(*command, arguments, Evaluate);
}

}  // namespace cairn::client
