#include "client/cli/commands.h"

namespace cairn::client {
namespace {

ExitCode EndSession(Program& program, const std::string& robot) {
  Request request;
  request.kind = RequestKind::kSessionEnd;
  request.robot = robot;
  if (const auto reply = program.Ask(request); !reply) return program.Refuse(reply.error());
  return program.Print("session of " + robot + " ended\n", {{"robot", robot}, {"ended", true}});
}

}  // namespace

void AddSession(CLI::App& app, Program& program) {
  auto* session = app.add_subcommand("session", "Robots' sessions");
  session->require_subcommand(1);
  auto* end = session->add_subcommand("end", "End a robot's session for good: its trajectory is complete");
  auto robot = std::make_shared<std::string>();
  end->add_option("robot", *robot, "The robot's name")->required();
  end->callback([&program, robot] { program.action = [&program, robot] { return EndSession(program, *robot); }; });
}

}  // namespace cairn::client
