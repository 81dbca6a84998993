#include <fmt/format.h>

#include <chrono>
#include <numbers>

#include "client/cli/commands.h"
#include "client/cli/frame_option.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "client/lib/pose_client.h"
#include "common/geometry/rotated_covariance.h"
#include "common/sensor/stamp.h"

namespace cairn::client {
namespace {

struct PoseArguments {
  std::string robot;
  std::optional<Stamp> at;
  bool hypotheses = false;
  bool follow = false;
  int count = 0;  // 0: until interrupted.
  std::string frame = "map";
};

// The covariance turns with the frame.
void MoveInto(PoseReport& pose, const Pose2& T_map_frame) {
  pose.T_map_robot = Between(T_map_frame, pose.T_map_robot);
  pose.T_map_odom = Between(T_map_frame, pose.T_map_odom);
  pose.covariance = Rotated(pose.covariance, -T_map_frame.theta);
}

ExitCode AskPose(Program& program, const PoseArguments& arguments) {
  auto pose = program.Ask([&](QueryClient& server) { return server.Pose(arguments.robot, arguments.at); });
  if (!pose) return program.Refuse(pose.error());
  const auto T_map_frame = FrameOfRobot(program, arguments.frame, arguments.robot);
  if (!T_map_frame) return program.Refuse(T_map_frame.error());
  if (arguments.frame != "map") MoveInto(*pose, *T_map_frame);
  return program.Print(FormatPose(*pose) + "\n", *pose);
}

ExitCode AskHypotheses(Program& program, const PoseArguments& arguments) {
  const auto hypotheses = program.Ask([&](QueryClient& server) { return server.Hypotheses(arguments.robot); });
  if (!hypotheses) return program.Refuse(hypotheses.error());
  std::string text = hypotheses->empty() ? arguments.robot + " is not localized\n" : "";
  for (const PoseHypothesis& one : *hypotheses) {
    text += fmt::format("{:5.1f} %  x {:.3f} m, y {:.3f} m, {:.1f} deg\n", 100.0 * one.weight, one.T_map_robot.x,
                        one.T_map_robot.y, one.T_map_robot.theta * 180.0 / std::numbers::pi);
  }
  return program.Print(text, {{"hypotheses", *hypotheses}});
}

ExitCode FollowPose(Program& program, const PoseArguments& arguments) {
  const auto bus = program.bus();
  if (!bus) return program.Refuse(bus.error());
  const auto poses = PoseClient::Create(**bus, arguments.robot);
  if (!poses) return program.Refuse(poses.error());
  const auto start = std::chrono::steady_clock::now();
  int seen = 0;
  while (!Interrupted() && (arguments.count == 0 || seen < arguments.count)) {
    if (const auto pose = (*poses)->Next(0.1)) {
      ++seen;
      program.Print(FormatPose(*pose) + "\n", *pose);
    } else if (seen == 0 && std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() >
                                program.options.timeout_s) {
      return program.Refuse({StatusCode::kDeadlineExceeded,
                             fmt::format("no pose of '{}' within {:g} s", arguments.robot, program.options.timeout_s)});
    }
  }
  return ExitCode::kOk;
}

ExitCode ShowPose(Program& program, const PoseArguments& arguments) {
  if (arguments.hypotheses) return AskHypotheses(program, arguments);
  return arguments.follow ? FollowPose(program, arguments) : AskPose(program, arguments);
}

Result<std::optional<Stamp>> ReadStamp(const std::string& text) {
  const auto stamp = ParseStamp(text);
  if (!stamp) return Fail(StatusCode::kInvalidArgument, "'" + text + "' is not a stamp in seconds, e.g. 976052890.25");
  return std::optional<Stamp>(*stamp);
}

}  // namespace

void AddPose(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("pose", "Where a robot is, or was");
  command->footer(
      "The pose is the robot's in the site's map frame, or with --frame in the building's: metres, radians in (-pi, "
      "pi].\n"
      "A stamp after the last used scan fails with UNAVAILABLE (not known yet).\n"
      "A stamp before the first fails with OUT_OF_RANGE.\n"
      "EXAMPLES\n  cairn pose robot1\n  cairn pose robot1 --at 976052890.25 --json\n  cairn pose robot1 --follow");
  auto arguments = std::make_shared<PoseArguments>();
  command->add_option("robot", arguments->robot, "The robot's name")->required();
  auto* at = AddParsed(*command, "--at", arguments->at, ReadStamp, "At this stamp of the robot's clock (interpolated)",
                       "SECONDS");
  auto* follow =
      command->add_flag("-f,--follow", arguments->follow, "Print every pose as it is published")->excludes(at);
  auto* hypotheses = command
                         ->add_flag("--hypotheses", arguments->hypotheses,
                                    "All places where it may be, with their share of the belief")
                         ->excludes(at)
                         ->excludes(follow);
  command->add_option("-n,--count", arguments->count, "With --follow: end after this many poses")
      ->needs(follow)
      ->check(Positive());
  AddFrame(*command, arguments->frame)->excludes(follow)->excludes(hypotheses);
  program.OnChosen(*command, arguments, ShowPose);
}

}  // namespace cairn::client
