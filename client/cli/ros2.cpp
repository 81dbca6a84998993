// cairn ros2: what the server sees of robots that run ROS 2.
#include <algorithm>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/lib/ros2_findings.h"

namespace cairn::client {
namespace {

ExitCode Diagnose(Program& program, const std::string& name) {
  const auto answer = program.Ask([](QueryClient& server) { return server.Ros2(); });
  if (!answer) return program.Refuse(answer.error());
  if (!answer->door.enabled) {
    return program.Refuse({StatusCode::kFailedPrecondition,
                           "the server does not serve ROS 2 robots: start it with --set ros2.enabled=true, or write "
                           "enabled: true below ros2: in its configuration (of the package: /etc/cairn/cairnd.yaml)"});
  }
  Ros2Report report = *answer;
  if (!name.empty()) {
    std::erase_if(report.namespaces, [&name](const Ros2Namespace& one) {
      return one.name != name && one.robot != name && one.name != "/" + name;
    });
  }
  return program.Print(FormatRos2(FindingsOf(report)), report);
}

}  // namespace

void AddRos2(CLI::App& app, Program& program) {
  auto* ros2 = app.add_subcommand("ros2", "Robots that run ROS 2: why one is not on the map");
  ros2->require_subcommand(1);
  auto* doctor = ros2->add_subcommand("doctor", "Why a ROS 2 robot is not on the map");
  doctor->footer(
      "Shows each namespace that publishes laser scans or odometry in the DDS domain of the ROS 2 robots: the robot "
      "and\n"
      "the site that the rules of the server give it, whether it is on the map, and what is wrong, in the order\n"
      "in which to mend it.\n"
      "EXAMPLES\n  cairn ros2 doctor\n  cairn ros2 doctor r1\n  cairn ros2 doctor --json");
  auto name = std::make_shared<std::string>();
  doctor->add_option("robot", *name, "Only this robot, or this namespace");
  program.OnChosen(*doctor, name, Diagnose);
}

}  // namespace cairn::client
