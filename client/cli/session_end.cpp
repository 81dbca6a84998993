#include "client/cli/commands.h"

namespace cairn::client {
namespace {

ExitCode EndSession(Program& program, const std::string& robot) {
  const auto ended = program.Ask([&](QueryClient& server) { return server.EndSession(robot); });
  if (!ended) return program.Refuse(ended.error());
  return program.Print("session of " + robot + " ended\n", {{"robot", robot}, {"ended", true}});
}

}  // namespace

void AddSession(CLI::App& app, Program& program) {
  auto* session = app.add_subcommand("session", "The sessions of robots");
  session->require_subcommand(1);
  auto* end = session->add_subcommand("end", "End a robot's session for good: its trajectory is complete");
  auto robot = std::make_shared<std::string>();
  end->add_option("robot", *robot, "The robot's name")->required();
  program.OnChosen(*end, robot, EndSession);
}

}  // namespace cairn::client
