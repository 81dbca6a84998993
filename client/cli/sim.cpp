#include <fmt/format.h>

#include <chrono>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/quantity_text.h"
#include "client/cli/sim_run.h"
#include "client/cli/sim_sensor_options.h"
#include "client/cli/window_option.h"
#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"

namespace cairn::client {
namespace {

std::string FormatReport(const SimReport& report, bool streamed) {
  std::string text;
  for (const SimRobotReport& robot : report.robots) {
    const Pose2& start = robot.T_map_robot_start;
    text += fmt::format("{} from {:.2f},{:.2f},{:.3f}", robot.robot, start.x, start.y, start.theta);
    if (streamed) {
      text += fmt::format(": {}; scan to pose p50 {:.1f} ms, p99 {:.1f} ms", FormatAccount(robot.account),
                          robot.latency_p50_ms, robot.latency_p99_ms);
    }
    text += "\n";
  }
  text += fmt::format("{} simulated in {} (x{:.2f})", FormatDuration(report.simulated_s), FormatDuration(report.took_s),
                      report.rate());
  if (streamed) {
    text += fmt::format("; scan published to pose received p50 {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms",
                        report.latency_p50_ms, report.latency_p99_ms, report.latency_max_ms);
  }
  if (report.watched_cpu_share)
    text += fmt::format("; watched process used {:.1f} % of a core", 100 * *report.watched_cpu_share);
  return text + "\n";
}

nlohmann::json ReportToJson(const SimReport& report) {
  nlohmann::json robots = nlohmann::json::array();
  for (const SimRobotReport& robot : report.robots) {
    nlohmann::json object = ToJson(robot.account);
    object.update({{"robot", robot.robot},
                   {"start", ToJson(robot.T_map_robot_start)},
                   {"pose_latency_p50_ms", robot.latency_p50_ms},
                   {"pose_latency_p99_ms", robot.latency_p99_ms}});
    robots.push_back(object);
  }
  nlohmann::json object = {{"robots", robots},
                           {"simulated_s", report.simulated_s},
                           {"took_s", report.took_s},
                           {"rate", report.rate()},
                           {"pose_latency_p50_ms", report.latency_p50_ms},
                           {"pose_latency_p99_ms", report.latency_p99_ms},
                           {"pose_latency_max_ms", report.latency_max_ms}};
  if (report.watched_cpu_share) object["watched_cpu_share"] = *report.watched_cpu_share;
  return object;
}

ExitCode Simulate(Program& program, const SimRunOptions& options) {
  if (options.stream && options.site.empty()) {
    program.err() << "cairn sim: --site is required (or --no-stream)\n";
    return ExitCode::kUsage;
  }
  const auto report = RunSim(program, options);
  if (!report) return program.Refuse(report.error());
  program.Print(FormatReport(*report, options.stream), ReportToJson(*report));
  return report->explained() ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace

void AddSim(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("sim", "Stream a simulated fleet into a site");
  std::string worlds;
  for (const std::string& name : sim::ShippedWorldNames()) worlds += " " + name;
  worlds += "; in space:";
  for (const std::string& name : sim::ShippedWorld3Names()) worlds += " " + name;
  command->footer(
      "Worlds that come with the program:" + worlds +
      "; the formats of others are in client/sim/README.md.\n"
      "Robots start at the true poses printed, so poses in the map compare with the truth as they are.\n"
      "The same seed gives the same scans. Exit code 1 where a scan is unexplained.\n"
      "EXAMPLES\n  cairn sim --world building --robots 3 --site hall --seconds 120 --truth-dir truth\n"
      "  cairn sim --robots 16 --beams 360 --hz 10 --site load --watch-pid $(pidof cairnd)\n"
      "  cairn sim --robots 1 --no-stream --log-dir logs --truth-dir truth\n"
      "  cairn sim --robots 1 --world hall3d --laser-model lms200 --nod=-60,45,36 --site hall --log-dir logs");
  auto options = std::make_shared<SimRunOptions>();
  auto start_seconds = std::make_shared<double>(0.0);
  command->add_option("--world", options->world, "A shipped world, or a world file (in space: .yaml)")
      ->capture_default_str();
  command->add_option("--site", options->site, "The site to map into");
  command->add_option("--robots", options->fleet.robots, "How many")->check(CLI::Range(1, 256))->capture_default_str();
  command->add_option("--prefix", options->prefix, "Robots are called PREFIX1, PREFIX2, ...")->capture_default_str();
  command->add_option("--seconds", options->seconds, "Simulated time")->check(InRange(0.1, 1e6))->capture_default_str();
  command->add_option("--seed", options->fleet.seed, "Of all randomness")->capture_default_str();
  auto model = AddSensorOptions(*command, options->fleet);
  auto* rate = command->add_option("--rate", options->rate, "How many times faster than real time")
                   ->check(InRange(1e-3, 1e4))
                   ->capture_default_str();
  command->add_flag("--fast", options->fast, "As fast as the server takes it, without losing a scan")->excludes(rate);
  AddWindowOption(*command, options->window);
  command->add_flag("!--no-stream", options->stream, "Need no server: only write the files");
  command->add_option("--truth-dir", options->truth_dir, "Write the true poses here (<robot>.tum)")->type_name("DIR");
  command->add_option("--log-dir", options->log_dir, "Write what is streamed here as CARMEN logs (<robot>.log)")
      ->type_name("DIR");
  command->add_option("--first-stamp", *start_seconds, "Of the first record; 0: now")
      ->check(CLI::NonNegativeNumber)
      ->type_name("SECONDS");
  command->add_flag("--end", options->end, "End the sessions afterwards (else they can be resumed)");
  command->add_option("--watch-pid", options->watched_pid, "Report this process's processor share")
      ->check(CLI::PositiveNumber);
  command->callback([&program, options, start_seconds, model] {
    program.action = [&program, options, start_seconds, model] {
      if (!model->empty()) {
        const auto laser = sim::WithModel(options->fleet.laser, *model);
        if (!laser) return program.Refuse(laser.error());
        options->fleet.laser = *laser;
      }
      options->fleet.first_stamp = *start_seconds > 0.0 ? StampFromSeconds(*start_seconds)
                                                        : std::chrono::duration_cast<std::chrono::nanoseconds>(
                                                              std::chrono::system_clock::now().time_since_epoch())
                                                              .count();
      return Simulate(program, *options);
    };
  });
}

}  // namespace cairn::client
