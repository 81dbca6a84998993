#include <fmt/format.h>

#include "client/cli/commands.h"
#include "client/cli/job_wait.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "common/service/start_pose.h"

namespace cairn::client {
namespace {

struct RelocaliseArguments {
  std::string robot;
  std::optional<Pose2> T_map_robot;
  bool no_wait = false;
};

// One line per place, the best one first.
std::string FormatPlaces(const Job& job) {
  std::string text;
  for (const PoseHypothesis& one : job.places) {
    const Pose2& pose = one.T_map_robot;
    text += fmt::format("{:5.1f} %  x {:.3f} m, y {:.3f} m, theta {:.1f} deg\n", 100.0 * one.weight, pose.x, pose.y,
                        pose.theta * 180.0 / kPi);
  }
  if (job.places.size() > 1)
    text += fmt::format("the second best place has {:.0f} % of the score of the best\n", 100.0 * Ambiguity(job));
  return text;
}

ExitCode FollowJob(Program& program, const RelocaliseArguments& arguments, const Job& submitted) {
  const auto job = arguments.no_wait ? Result<Job>(submitted) : WaitForEnd(program, submitted);
  if (!job) return program.Refuse(job.error());
  nlohmann::json object = *job;
  object["accepted"] = true;
  const bool succeeded = job->state == JobState::kSucceeded;
  program.Print(FormatJob(*job) + "\n" + (succeeded ? FormatPlaces(*job) : std::string()), object);
  return arguments.no_wait || succeeded ? ExitCode::kOk : ExitCode::kFailed;
}

ExitCode Relocalise(Program& program, const RelocaliseArguments& arguments) {
  const auto taken =
      program.Ask([&](QueryClient& server) { return server.Relocalise(arguments.robot, arguments.T_map_robot); });
  if (!taken) return program.Refuse(taken.error());
  if (*taken) return FollowJob(program, arguments, **taken);
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
      "From now on the robot is not localized, and nothing is drawn of it, until what it sees agrees with the map.\n"
      "With --here one scan can be enough, where its own map shows the place; it is looked for near that pose\n"
      "(slam.recovery.near_m, near_rad). Otherwise it looks for itself in its own map, and has to drive until two\n"
      "searches agree. In both cases a job looks for it in the map of its site: near that pose first, otherwise\n"
      "everywhere, and ranks all places where it may be. If it sees what the map shows near that pose, or if the best\n"
      "place has no rival, the robot's next scans have to confirm it; otherwise nothing is changed, and --here "
      "decides.\n"
      "A robot that is not joined with the map of its site is joined by --here, if what it has seen agrees with the\n"
      "map there. The exit code says whether the job succeeded; interrupting only stops the waiting.\n"
      "EXAMPLES\n  cairn robot relocalise robot1 --here 12.5,-3,90deg\n  cairn robot relocalise robot1");
  auto arguments = std::make_shared<RelocaliseArguments>();
  relocalise->add_option("robot", arguments->robot, "The robot's name")->required();
  AddParsed(*relocalise, "--here", arguments->T_map_robot, ParseStart, "Where it is, in the map of its site",
            "X,Y,THETA");
  relocalise->add_flag("--no-wait", arguments->no_wait, "Do not wait until the job has ended");
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
