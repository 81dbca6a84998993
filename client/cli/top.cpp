#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <optional>
#include <utility>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/top_table.h"
#include "client/cli/top_terminal.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

struct TopArguments {
  double interval_s = 1.0;
  int count = 0;  // 0: until interrupted.
};

Result<TopView> AskServer(Program& program) {
  TopView view;
  auto status = program.Ask([](QueryClient& server) { return server.ServerStatus(); });
  if (!status) return tl::unexpected(status.error());
  auto maps = program.Ask([](QueryClient& server) { return server.Maps(); });
  if (!maps) return tl::unexpected(maps.error());
  auto jobs = program.Ask([](QueryClient& server) { return server.Jobs(); });
  if (!jobs) return tl::unexpected(jobs.error());
  // An addition only: the rest is shown where there is no answer to this.
  auto ros2 = program.Ask([](QueryClient& server) { return server.Ros2(); });
  if (ros2) view.ros2 = std::move(*ros2);
  view.status = std::move(*status);
  std::ranges::stable_sort(view.status.robots, {}, [](const RobotStatus& robot) { return robot.session.robot; });
  view.maps = std::move(*maps);
  view.jobs = std::move(*jobs);
  view.seconds = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  return view;
}

nlohmann::json ToJson(const TopView& view) {
  nlohmann::json object = {{"robots", view.status.robots},
                           {"sites", view.maps},
                           {"jobs", view.jobs},
                           {"degraded", view.status.degraded},
                           {"load", view.status.load}};
  if (view.ros2.door.enabled) object["ros2"] = view.ros2;
  return object;
}

ExitCode ShowTop(Program& program, const TopArguments& arguments) {
  // On a terminal each table takes the place of the one before; in a file or a pipe they follow each other.
  const bool screen = &program.out() == &std::cout && isatty(STDOUT_FILENO) != 0 && !program.options.json;
  const auto interval =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(arguments.interval_s));
  std::optional<TopView> before;
  for (int shown = 0; !Interrupted() && (arguments.count == 0 || shown < arguments.count); ++shown) {
    const bool last = shown + 1 == arguments.count;
    auto now = AskServer(program);
    // The server may be started again; where nobody looks at it, its silence ends the command.
    if (!now && (!screen || shown == 0)) return program.Refuse(now.error());
    const auto text = [&](const TerminalSize& size) {
      return now ? FormatTop(*now, before ? &*before : nullptr, size) : FitTerminal(now.error().message + "\n", size);
    };
    const auto next = Clock::now() + (last ? Clock::duration::zero() : interval);
    if (screen) {
      if (!DrawUntil(program.out(), text, next)) break;
    } else {
      program.Print((shown > 0 ? "\n" : "") + text({}), ToJson(*now));
      WaitUntil(next);
    }
    if (now) before = std::move(*now);
  }
  return ExitCode::kOk;
}

}  // namespace

void AddTop(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("top", "Server, sites, jobs and robots, shown again and again until q or Ctrl-C");
  command->footer(
      "How busy the server is and what it refused; one line for each site, with its enabled version, its epoch, the\n"
      "memory that its map takes and its jobs that are not finished; problems of ROS 2 robots (see `cairn ros2\n"
      "doctor`); jobs that are not finished; and one line for each robot: state, pose, doubt of the position, scans\n"
      "used and dropped in a second, scans that wait, time from scan to pose. What does not fit the terminal is cut.\n"
      "EXAMPLES\n  cairn top\n  cairn top --interval 5\n  cairn top -n 1 --json");
  auto arguments = std::make_shared<TopArguments>();
  command->add_option("--interval", arguments->interval_s, "Time between two tables")
      ->type_name("SECONDS")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("-n,--count", arguments->count, "End after this many tables")->check(Positive());
  program.OnChosen(*command, arguments, ShowTop);
}

}  // namespace cairn::client
