#include "client/cli/cloud_export.h"

#include <fmt/format.h>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/sim/shipped_worlds.h"
#include "common/bag/recording.h"
#include "common/sensor/log_options.h"

namespace cairn::client {
namespace {

struct CloudArguments {
  CloudExportOptions options;
  std::string robot;
  std::string trajectory;
  bool smoothed = false;
};

Result<Trajectory> PathOf(Program& program, const CloudArguments& arguments) {
  if (!arguments.trajectory.empty()) return ReadTum(arguments.trajectory);
  return program.Ask([&](QueryClient& server) { return server.Path(arguments.robot, arguments.smoothed); })
      .map([](PathAnswer&& path) { return std::move(path.poses); });
}

ExitCode Export(Program& program, const CloudArguments& arguments) {
  const CloudExportOptions& options = arguments.options;
  if (arguments.robot.empty() == arguments.trajectory.empty()) {
    program.err() << "cairn cloud export: give either --robot (asks the server) or --trajectory\n";
    return ExitCode::kUsage;
  }
  // Checked before anything is read, so that a wrong file name is reported at once.
  if (const auto format = CloudFormatOf(options.output, options.text); !format) {
    program.err() << "cairn cloud export: " << format.error().message << "\n";
    return ExitCode::kUsage;
  }
  const auto path = PathOf(program, arguments);
  if (!path) return program.Refuse(path.error());
  const auto report = ExportCloud(*path, options);
  if (!report) return program.Refuse(report.error());

  nlohmann::json object = {{"file", options.output},
                           {"points", report->points},
                           {"scans_used", report->scans_used},
                           {"scans_tilted", report->scans_tilted},
                           {"scans_level_left_out", report->scans_level},
                           {"scans_invalid", report->scans_invalid},
                           {"scans_without_pose", report->scans_without_pose}};
  std::string text = fmt::format("{}: {} points of {} scans ({} tilted)", options.output, report->points,
                                 report->scans_used, report->scans_tilted);
  if (report->scans_without_pose > 0) text += fmt::format(", {} without a pose", report->scans_without_pose);
  if (report->scans_invalid > 0) text += fmt::format(", {} not valid", report->scans_invalid);
  text += "\n";
  if (report->wall_error) {
    const sim::CloudError& e = *report->wall_error;
    text += fmt::format("wall error against {}: mean {:.4f} m, rms {:.4f}, median {:.4f}, p95 {:.4f}, max {:.3f}\n",
                        options.truth_world, e.mean_m, e.rms_m, e.median_m, e.p95_m, e.max_m);
    object["wall_error_m"] = {
        {"mean", e.mean_m}, {"rms", e.rms_m}, {"median", e.median_m}, {"p95", e.p95_m}, {"max", e.max_m}};
  }
  return program.Print(text, object);
}

void AddCloudExport(CLI::App& cloud, Program& program) {
  auto* command =
      cloud.add_subcommand("export", "Write a point cloud, made from a log with tilted scans and a robot's path");
  command->footer(
      "The path comes from the server (--robot) or from a TUM file; scans come from the log, level and tilted ones\n"
      "(TILTLASER1 lines, as `cairn sim --nod` writes them). The file's ending says the format: .ply or .pcd.\n"
      "EXAMPLES\n  cairn cloud export robot1.log --robot robot1 --height 0.4 -o hall.ply\n"
      "  cairn cloud export robot1.log --trajectory robot1.tum --height 0.4 --tilted-only --voxel 0.02 -o hall.pcd\n"
      "  cairn cloud export robot1.log --trajectory robot1.tum --height 0.4 -o hall.ply --truth-world hall3d");
  auto arguments = std::make_shared<CloudArguments>();
  CloudExportOptions& options = arguments->options;
  command->add_option("log", options.log, "Log, ROS 2 bag or recording with the scans")->required();
  command->add_option("-o,--output", options.output, "File to write: .ply or .pcd")->required()->type_name("FILE");
  command->add_option("--robot", arguments->robot, "The robot whose path is asked from the server");
  command->add_flag("--smoothed", arguments->smoothed,
                    "Take the path of the enabled smoothing job instead of the live one");
  command->add_option("--trajectory", arguments->trajectory, "TUM file with the path")->type_name("FILE");
  AddNumber(*command, "--height", options.cloud.height_m, -1000.0, 1000.0, "Height of the scanner above the floor",
            "METRES");
  AddNumber(*command, "--voxel", options.cloud.voxel_m, 0.0, 100.0, "Keep one point per cube of this size; 0: all",
            "METRES");
  command->add_option("--max-range", options.cloud.max_range_m, "Leave out hits farther away")
      ->check(Positive())
      ->type_name("METRES");
  command->add_option("--max-gap", options.cloud.max_pose_gap_s, "Longest time between the two poses around a scan")
      ->check(Positive())
      ->type_name("SECONDS")
      ->capture_default_str();
  AddLogOptions(*command, options.reader);
  command->add_flag("--tilted-only", options.cloud.tilted_only, "Leave out level scans");
  command->add_flag("--text", options.text, "Write numbers as text instead of binary");
  command->add_option("--truth-world", options.truth_world, "Also measure the cloud against this world in space");
  program.OnChosen(*command, arguments, Export);
}

}  // namespace

Result<CloudExportReport> ExportCloud(const Trajectory& path, const CloudExportOptions& options) {
  const auto format = CloudFormatOf(options.output, options.text);
  if (!format) return tl::unexpected(format.error());
  if (auto valid = Validate(options.cloud); !valid) return tl::unexpected(valid.error());
  std::optional<sim::World3> truth;
  if (!options.truth_world.empty()) {
    auto opened = sim::OpenWorld3(options.truth_world);
    if (!opened) return tl::unexpected(opened.error());
    truth = std::move(*opened);
  }
  CloudBuilder builder(path, options.cloud);
  Result<void> added;
  const auto read = ReadRecording(options.log, options.reader, [&](LogRecord&& record) {
    if (const auto* scan = std::get_if<Scan>(&record)) added = builder.Add(*scan);
    return added.has_value();
  });
  if (!read) return tl::unexpected(read.error());
  if (!added) return tl::unexpected(added.error());
  if (builder.scans_used() == 0)
    return Fail(StatusCode::kFailedPrecondition,
                options.log + ": no scan could be placed (" + std::to_string(builder.scans_without_pose()) +
                    " without a pose on the path, " + std::to_string(builder.scans_invalid()) + " not valid, " +
                    std::to_string(builder.scans_level()) + " level)");
  if (auto written = WriteCloud(builder.cloud(), *format, options.output); !written)
    return tl::unexpected(written.error());
  CloudExportReport report{builder.cloud().size(),
                           builder.scans_used(),
                           builder.scans_tilted(),
                           builder.scans_level(),
                           builder.scans_invalid(),
                           builder.scans_without_pose(),
                           std::nullopt};
  if (truth) report.wall_error = sim::MeasureCloud(builder.cloud(), sim::RectangleTree(std::move(truth->rectangles)));
  return report;
}

void AddCloud(CLI::App& app, Program& program) {
  auto* cloud = app.add_subcommand("cloud", "Point clouds in space, from tilted scans");
  cloud->require_subcommand(1);
  AddCloudExport(*cloud, program);
}

}  // namespace cairn::client
