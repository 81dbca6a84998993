#include <fmt/format.h>

#include "client/cli/commands.h"
#include "client/cli/frame_option.h"
#include "client/cli/json_output.h"
#include "common/sensor/stamp.h"

namespace cairn::client {
namespace {

struct PathArguments {
  std::string robot;
  std::string file;
  bool smoothed = false;
  std::string frame = "map";
};

double LengthOf(const Trajectory& path) {
  double length = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    length += (path[i].T_map_robot.translation() - path[i - 1].T_map_robot.translation()).norm();
  }
  return length;
}

ExitCode ShowPath(Program& program, const PathArguments& arguments) {
  auto answer = program.Ask([&](QueryClient& server) { return server.Path(arguments.robot, arguments.smoothed); });
  if (!answer) return program.Refuse(answer.error());
  if (arguments.frame != "map") {
    const auto T_map_frame = FrameOfRobot(program, arguments.frame, arguments.robot);
    if (!T_map_frame) return program.Refuse(T_map_frame.error());
    MoveInto(answer->poses, *T_map_frame);
  }
  const Trajectory& path = answer->poses;
  nlohmann::json object = {{"robot", arguments.robot},   {"smoothed", arguments.smoothed},
                           {"frame", arguments.frame},   {"poses", path.size()},
                           {"length_m", LengthOf(path)}, {"map_epoch", answer->map_epoch}};
  std::string text;
  if (!arguments.file.empty()) {
    if (const auto written = WriteTum(path, arguments.file); !written) return program.Refuse(written.error());
    object["file"] = arguments.file;
    text = fmt::format("{}: {} poses, {:.1f} m\n", arguments.file, path.size(), LengthOf(path));
  } else {
    object["path"] = nlohmann::json::array();
    for (const StampedPose& pose : path) {
      object["path"].push_back({{"stamp", pose.stamp}, {"pose", pose.T_map_robot}});
      text += fmt::format("{} {:.6f} {:.6f} {:.6f}\n", FormatStamp(pose.stamp), pose.T_map_robot.x, pose.T_map_robot.y,
                          pose.T_map_robot.theta);
    }
  }
  return program.Print(text, object);
}

}  // namespace

void AddPath(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("path", "All poses of a robot so far");
  command->footer(
      "The poses lie where they are in the present map, which may have been corrected since they were published.\n"
      "Without -o the poses are printed as `seconds x y theta`; with it they are written as a TUM trajectory.\n"
      "EXAMPLES\n  cairn path robot1 -o robot1.tum\n  cairn path robot1 --smoothed -o robot1-smooth.tum");
  auto arguments = std::make_shared<PathArguments>();
  command->add_option("robot", arguments->robot, "The robot's name")->required();
  command->add_option("-o,--output", arguments->file, "TUM file to write")->type_name("FILE");
  command->add_flag("--smoothed", arguments->smoothed,
                    "Show the path of the enabled smoothing job instead of the live one");
  AddFrame(*command, arguments->frame);
  program.OnChosen(*command, arguments, ShowPath);
}

}  // namespace cairn::client
