#include <algorithm>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

ExitCode ShowStatus(Program& program, const std::string& robot) {
  auto answer = program.Ask([&](QueryClient& server) { return server.ServerStatus(robot); });
  if (!answer) return program.Refuse(answer.error());
  std::ranges::stable_sort(answer->robots, {}, [](const RobotStatus& status) { return status.session.robot; });
  std::string text;
  if (!answer->degraded.empty()) text += "DEGRADED: " + answer->degraded + "\n";
  if (answer->robots.empty()) text += "no robot yet\n";
  for (const RobotStatus& status : answer->robots) text += FormatRobot(status);
  text += FormatLoad(answer->load) + FormatRefusals(answer->refused);
  nlohmann::json object = {
      {"robots", answer->robots}, {"degraded", answer->degraded}, {"refused", answer->refused}, {"load", answer->load}};
  if (robot.empty()) {
    // Additions only: the status does not fail where these questions do.
    const auto maps = program.Ask([](QueryClient& server) { return server.Maps(); });
    if (maps) text += FormatMemoryNotes(*maps);
    nlohmann::json notes = nlohmann::json::array();
    for (const MapInfo& map : maps.value_or(std::vector<MapInfo>{}))
      if (!map.memory_note.empty()) notes.push_back({{"site", map.site}, {"memory_note", map.memory_note}});
    object["memory"] = std::move(notes);
    const auto ros2 = program.Ask([](QueryClient& server) { return server.Ros2(); });
    if (ros2) text += FormatRos2Door(*ros2);
    if (ros2 && ros2->door.enabled)
      object["ros2"] = {{"robots", ros2->namespaces.size()}, {"not_on_map", RobotsOffMap(*ros2)}};
  }
  return program.Print(text, object);
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
      "names the senders. Where a site has given something up to stay below maps.max_memory_mib, or ROS 2 robots are\n"
      "not on the map, a line says so.\n"
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
  end->footer(
      "The path of the robot is fitted to all that it has seen again, and its map is drawn along it within about a\n"
      "second. Both stay; the session cannot be taken up again. A new one of the same robot, such as another replay,\n"
      "says where the robot starts (--start), or is not joined until it has driven where others have.\n"
      "EXAMPLES\n  cairn session end robot1");
  end->add_option("robot", *robot, "The robot's name")->required();
  program.OnChosen(*end, robot, EndSession);
}

}  // namespace cairn::client
