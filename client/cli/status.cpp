#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

ExitCode ShowStatus(Program& program, const std::string& robot) {
  Request request;
  request.kind = RequestKind::kStatus;
  request.robot = robot;
  const auto reply = program.Ask(request);
  if (!reply) return program.Refuse(reply.error());
  std::string text = reply->robots.empty() ? "no robot yet\n" : "";
  nlohmann::json robots = nlohmann::json::array();
  for (const RobotStatus& status : reply->robots) {
    text += FormatRobot(status);
    robots.push_back(ToJson(status));
  }
  return program.Print(text, {{"robots", robots}});
}

}  // namespace

void AddStatus(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("status", "Sessions, poses and ledgers of all robots, or of one");
  command->footer(
      "The ledger says what became of every scan: received = used + dropped (by reason) + waiting.\n"
      "EXAMPLES\n  cairn status\n  cairn status robot1 --json");
  auto robot = std::make_shared<std::string>();
  command->add_option("robot", *robot, "Only this robot");
  command->callback([&program, robot] { program.action = [&program, robot] { return ShowStatus(program, *robot); }; });
}

}  // namespace cairn::client
