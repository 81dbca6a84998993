#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"
#include "client/cli/trajectory_error.h"

namespace cairn::client {
namespace {

struct EvalArguments {
  std::string estimate;
  std::string truth;
  std::string align = "none";
  double max_rmse_m = 0.0;
};

ExitCode Evaluate(Program& program, const EvalArguments& arguments) {
  const auto estimate = ReadTum(arguments.estimate);
  if (!estimate) return program.Refuse(estimate.error());
  const auto truth = ReadTum(arguments.truth);
  if (!truth) return program.Refuse(truth.error());
  const auto error =
      CompareTrajectories(*estimate, *truth, arguments.align == "se2" ? Alignment::kSe2 : Alignment::kNone);
  if (!error) return program.Refuse(error.error());
  program.Print(FormatTrajectoryError(*error), *error);
  const bool within = arguments.max_rmse_m == 0.0 || error->rmse_m <= arguments.max_rmse_m;
  return within ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace

void AddEval(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("eval", "Error of a trajectory against the truth; needs no server");
  command->footer(
      "Prints the absolute trajectory error (ATE): how far the estimate is from the truth at each stamp of the "
      "estimate.\n"
      "The truth is interpolated between its poses. Both are TUM files.\n"
      "EXAMPLES\n  cairn eval robot1.tum truth/robot1.tum\n  cairn eval a.tum b.tum --align se2 --max-rmse 0.1");
  auto arguments = std::make_shared<EvalArguments>();
  command->add_option("estimate", arguments->estimate, "TUM file")->required()->type_name("FILE");
  command->add_option("truth", arguments->truth, "TUM file")->required()->type_name("FILE");
  command->add_option("--align", arguments->align, "Move the estimate to fit best before comparing")
      ->check(CLI::IsMember({"none", "se2"}))
      ->capture_default_str();
  command->add_option("--max-rmse", arguments->max_rmse_m, "Exit code 1 where the ATE is larger")
      ->check(CLI::PositiveNumber)
      ->type_name("METRES");
  program.OnChosen(*command, arguments, Evaluate);
}

}  // namespace cairn::client
