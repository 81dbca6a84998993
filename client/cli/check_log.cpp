#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/log_check.h"
#include "client/cli/log_options.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

struct CheckArguments {
  std::string log;
  LogReaderOptions reader;
};

ExitCode CheckLog(Program& program, const CheckArguments& arguments) {
  LogCheck check;
  const auto summary = ReadLog(arguments.log, arguments.reader, [&check](LogRecord&& record) {
    check.Add(record);
    return !Interrupted();
  });
  if (!summary) return program.Refuse(summary.error());
  const LogReport report = check.Finish(*summary);
  program.Print(FormatLogReport(report), report);
  return report.has_errors() ? ExitCode::kFailed : ExitCode::kOk;
}

}  // namespace

void AddCheckLog(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("check-log", "Say whether a robot log is fit for mapping; needs no server");
  command->footer(
      "Reads CARMEN and DP-SLAM logs. Exit code 1 where scans would be lost (each finding says why and what to do).\n"
      "EXAMPLES\n  cairn check-log intel.clf\n  cairn check-log run.log --json");
  auto arguments = std::make_shared<CheckArguments>();
  command->add_option("log", arguments->log, "The log file")->required()->type_name("FILE");
  AddLogOptions(*command, arguments->reader);
  program.OnChosen(*command, arguments, CheckLog);
}

}  // namespace cairn::client
