#include "client/cli/commands.h"
#include "client/cli/option_checks.h"
#include "common/service/start_pose.h"

namespace cairn::client {
namespace {

struct RelocaliseArguments {
  std::string robot;
  std::optional<Pose2> T_map_robot;
};

ExitCode Relocalise(Program& program, const RelocaliseArguments& arguments) {
  const auto taken =
      program.Ask([&](QueryClient& server) { return server.Relocalise(arguments.robot, arguments.T_map_robot); });
  if (!taken) return program.Refuse(taken.error());
  const std::string where = arguments.T_map_robot ? "near the pose given" : "anywhere in its map";
  return program.Print(arguments.robot + " has to be found again, " + where + "; cairn status says when it is\n",
                       {{"robot", arguments.robot}, {"accepted", true}});
}

struct ModeArguments {
  std::string robot;
};

ExitCode Localise(Program& program, const ModeArguments& arguments) {
  const auto taken = program.Ask([&](QueryClient& server) { return server.Localise(arguments.robot); });
  if (!taken) return program.Refuse(taken.error());
  return program.Print(arguments.robot + " is only localised from now on, in the map of its site\n",
                       {{"robot", arguments.robot}, {"accepted", true}});
}

ExitCode MapAgain(Program& program, const ModeArguments& arguments) {
  const auto taken = program.Ask([&](QueryClient& server) { return server.MapAgain(arguments.robot); });
  if (!taken) return program.Refuse(taken.error());
  return program.Print(arguments.robot + " maps from now on\n", {{"robot", arguments.robot}, {"accepted", true}});
}

}  // namespace

void AddRobot(CLI::App& app, Program& program) {
  auto* robot = app.add_subcommand("robot", "Have a robot found again, only localised, or mapping again");
  robot->require_subcommand(1);
  auto* relocalise = robot->add_subcommand("relocalise", "Have a robot found again that is not where its pose says");
  relocalise->footer(
      "From now on the robot is not localized, and nothing is drawn of it, until what it sees agrees with its own "
      "map.\n"
      "With --here one scan can be enough; it is looked for near that pose (slam.recovery.near_m, near_rad). Otherwise "
      "it\n"
      "is looked for in all of its map, and has to drive until two searches agree.\n"
      "EXAMPLES\n  cairn robot relocalise robot1 --here 12.5,-3,90deg\n  cairn robot relocalise robot1");
  auto arguments = std::make_shared<RelocaliseArguments>();
  relocalise->add_option("robot", arguments->robot, "The robot's name")->required();
  AddParsed(*relocalise, "--here", arguments->T_map_robot, ParseStart, "Where it is, in the map of its site",
            "X,Y,THETA");
  program.OnChosen(*relocalise, arguments, Relocalise);

  auto* localise = robot->add_subcommand("localise", "Have a robot only localised, in the map of its site");
  localise->footer(
      "From now on nothing is drawn of the robot, and the map that others have made stays as it is. The robot is "
      "looked\n"
      "for in that map: near where it is, if that is known, otherwise everywhere, and then it has to drive until two\n"
      "searches agree. Where the map changes, it is given to the robot again.\n"
      "EXAMPLE\n  cairn robot localise robot1");
  auto localised = std::make_shared<ModeArguments>();
  localise->add_option("robot", localised->robot, "The robot's name")->required();
  program.OnChosen(*localise, localised, Localise);

  auto* map = robot->add_subcommand("map", "Have a robot map again that was only localised");
  map->footer(
      "It maps from where it is. If it has mapped before, its scans must agree with its own map first.\n"
      "EXAMPLE\n  cairn robot map robot1");
  auto mapping = std::make_shared<ModeArguments>();
  map->add_option("robot", mapping->robot, "The robot's name")->required();
  program.OnChosen(*map, mapping, MapAgain);
}

}  // namespace cairn::client
