#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

ExitCode ShowStatus(Program& program, const std::string& robot) {
  const auto answer = program.Ask([&](QueryClient& server) { return server.ServerStatus(robot); });
  if (!answer) return program.Refuse(answer.error());
  std::string text;
  if (!answer->degraded.empty()) text += "DEGRADED: " + answer->degraded + "\n";
  if (answer->robots.empty()) text += "no robot yet\n";
  for (const RobotStatus& status : answer->robots) text += FormatRobot(status);
  text += FormatLoad(answer->load) + FormatRefusals(answer->refused);
  return program.Print(text, {{"robots", answer->robots},
                              {"degraded", answer->degraded},
                              {"refused", answer->refused},
                              {"load", answer->load}});
}

ExitCode EndSession(Program& program, const std::string& robot) {
  const auto ended = program.Ask([&](QueryClient& server) { return server.EndSession(robot); });
  if (!ended) return program.Refuse(ended.error());
  return program.Print("session of " + robot + " ended\n", {{"robot", robot}, {"ended", true}});
}

}  // namespace

void AddStatus(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("status", "Sessions, poses and ledgers of all robots, or of one");
  command->footer(
      "The ledger says what became of every scan: received = used + dropped (by reason) + waiting.\n"
      "The last lines say how busy the server is and count what it refused because of its sender. The server's log\n"
      "names the senders.\n"
      "EXAMPLES\n  cairn status\n  cairn status robot1 --json");
  auto robot = std::make_shared<std::string>();
  command->add_option("robot", *robot, "Only this robot");
  program.OnChosen(*command, robot, ShowStatus);
}

void AddSession(CLI::App& app, Program& program) {
  auto* session = app.add_subcommand("session", "The sessions of robots");
  session->require_subcommand(1);
  auto* end = session->add_subcommand("end", "End a robot's session for good: its trajectory is complete");
  auto robot = std::make_shared<std::string>();
  end->add_option("robot", *robot, "The robot's name")->required();
  program.OnChosen(*end, robot, EndSession);
}

}  // namespace cairn::client
