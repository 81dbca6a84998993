#include <unistd.h>

#include <chrono>
#include <iostream>
#include <optional>
#include <utility>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/top_table.h"

namespace cairn::client {
namespace {

struct TopArguments {
  double interval_s = 1.0;
  int count = 0;  // 0: until interrupted.
};

Result<TopView> AskServer(Program& program) {
  TopView view;
  auto status = program.Ask([](QueryClient& server) { return server.ServerStatus(); });
  if (!status) return tl::unexpected(status.error());
  auto jobs = program.Ask([](QueryClient& server) { return server.Jobs(); });
  if (!jobs) return tl::unexpected(jobs.error());
  view.status = std::move(*status);
  view.jobs = std::move(*jobs);
  view.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  return view;
}

ExitCode ShowTop(Program& program, const TopArguments& arguments) {
  // On a terminal each table takes the place of the one before; in a file or a pipe they follow each other.
  const bool screen = &program.out() == &std::cout && isatty(STDOUT_FILENO) != 0 && !program.options.json;
  std::optional<TopView> before;
  for (int shown = 0; !Interrupted() && (arguments.count == 0 || shown < arguments.count); ++shown) {
    if (shown > 0) {
      const std::chrono::duration<double> interval(arguments.interval_s);
      WaitUntil(std::chrono::steady_clock::now() +
                std::chrono::duration_cast<std::chrono::steady_clock::duration>(interval));
      if (Interrupted()) break;
    }
    auto now = AskServer(program);
    // The server may be started again; where nobody looks at it, its silence ends the command.
    if (!now && (!screen || shown == 0)) return program.Refuse(now.error());
    std::string text = now ? FormatTop(*now, before ? &*before : nullptr) : now.error().message + "\n";
    if (screen) {
      text.insert(0, "\x1b[H\x1b[2J");
    } else if (shown > 0) {
      text.insert(0, "\n");
    }
    nlohmann::json object;
    if (now) {
      object = {{"robots", now->status.robots},
                {"jobs", now->jobs},
                {"degraded", now->status.degraded},
                {"load", now->status.load}};
      before = std::move(*now);
    }
    program.Print(text, object);
    program.out().flush();
  }
  return ExitCode::kOk;
}

}  // namespace

void AddTop(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("top", "Robots and jobs, shown again and again until Ctrl-C");
  command->footer(
      "One line for each robot: state, pose, doubt of the position, scans used and dropped in a second, scans that "
      "wait,\n"
      "time from scan to pose. Below: jobs that are not finished, and what the server refused.\n"
      "EXAMPLES\n  cairn top\n  cairn top --interval 5\n  cairn top -n 1 --json");
  auto arguments = std::make_shared<TopArguments>();
  command->add_option("--interval", arguments->interval_s, "Time between two tables")
      ->type_name("SECONDS")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("-n,--count", arguments->count, "End after this many tables")->check(CLI::PositiveNumber);
  program.OnChosen(*command, arguments, ShowTop);
}

}  // namespace cairn::client
