#include <fmt/format.h>

#include <chrono>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/quantity_text.h"
#include "client/cli/robot_stream.h"
#include "client/cli/sim_run.h"
#include "client/sim/laser.h"
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
    nlohmann::json& object = robots.emplace_back(robot.account);
    object.update({{"robot", robot.robot},
                   {"start", robot.T_map_robot_start},
                   {"pose_latency_p50_ms", robot.latency_p50_ms},
                   {"pose_latency_p99_ms", robot.latency_p99_ms}});
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

struct SimArguments {
  SimRunOptions run;
  double first_stamp_s = 0.0;  // 0: now.
};

ExitCode Simulate(Program& program, const SimArguments& arguments) {
  SimRunOptions options = arguments.run;
  if (options.stream && options.site.empty()) {
    program.err() << "cairn sim: --site is required (or --no-stream)\n";
    return ExitCode::kUsage;
  }
  const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
  options.fleet.first_stamp = arguments.first_stamp_s > 0.0 ? StampFromSeconds(arguments.first_stamp_s) : now.count();
  const auto report = RunSim(program, options);
  if (!report) return program.Refuse(report.error());
  program.Print(FormatReport(*report, options.stream), ReportToJson(*report));
  return report->explained() ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace

void AddSim(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("sim", "Stream a simulated fleet of robots to the server");
  std::string worlds;
  for (const std::string& name : sim::ShippedWorldNames()) worlds += " " + name;
  command->footer(
      "Worlds that come with the program:" + worlds +
      ". client/sim/README.md explains how to write others.\n"
      "Each robot tells the server its true start, so the poses in the map can be compared with the truth directly.\n"
      "With --unknown-starts the frame of the map is the start of the first robot.\n"
      "The same seed gives the same scans. Exit code 1 if the server cannot say what became of a scan.\n"
      "EXAMPLES\n  cairn sim --world building --robots 3 --site hall --seconds 120 --truth-dir truth\n"
      "  cairn sim --robots 16 --beams 360 --hz 10 --site load --watch-pid $(pidof cairnd)\n"
      "  cairn sim --robots 1 --no-stream --log-dir logs --truth-dir truth --laser-model rplidar-a1\n"
      "  cairn sim --robots 1 --world hall3d --laser-model lms200 --nod=-60,45,36 --site hall --log-dir logs");
  auto arguments = std::make_shared<SimArguments>();
  SimRunOptions* options = &arguments->run;
  command->add_option("--world", options->world, "A shipped world, or the path of a world file (YAML)")
      ->capture_default_str();
  command->add_option("--site", options->site, "The site to map into");
  command->add_option("--robots", options->fleet.robots, "Number of robots")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command->add_option("--prefix", options->prefix, "Robots are called PREFIX1, PREFIX2, ...")->capture_default_str();
  AddNumber(*command, "--seconds", options->seconds, 0.1, 1e6, "Simulated time");
  command->add_option("--seed", options->fleet.seed, "Seed of all random numbers")->capture_default_str();
  command
      ->add_option("--furniture", options->fleet.furniture.pieces,
                   "Pieces of furniture beside the routes; in a full place there are fewer")
      ->check(CLI::Range(0, 1000));
  command
      ->add_option("--furniture-seed", options->fleet.furniture.seed,
                   "With another one they stand elsewhere, as in a place that has changed since the last run")
      ->capture_default_str();
  AddSensorOptions(*command, options->fleet);
  auto* rate = AddNumber(*command, "--rate", options->rate, 1e-3, 1e4, "How many times faster than real time");
  command->add_flag("--fast", options->fast, "As fast as the server takes it, without losing a scan")->excludes(rate);
  AddWindowOption(*command, options->window);
  command->add_flag("!--no-stream", options->stream, "Only write the files; no server is needed");
  command->add_option("--truth-dir", options->truth_dir, "Write the true poses here (<robot>.tum)")->type_name("DIR");
  command->add_option("--log-dir", options->log_dir, "Write what is streamed here as CARMEN logs (<robot>.log)")
      ->type_name("DIR");
  command->add_option("--first-stamp", arguments->first_stamp_s, "Stamp of the first record; 0: now")
      ->check(NotNegative())
      ->type_name("SECONDS");
  command->add_flag(
      "!--unknown-starts", options->starts_known,
      "The robots do not say where they start. The first one begins the map; the others are joined with it "
      "once they have seen enough of the same places");
  command->add_flag("!--unseen", options->fleet.see_each_other, "The robots do not appear in each other's scans");
  command->add_flag("--end", options->end, "End the sessions afterwards; without this they can be resumed");
  command
      ->add_option("--watch-pid", options->watched_pid,
                   "Report how much processor time this process uses (e.g. the server)")
      ->check(Positive());
  program.OnChosen(*command, arguments, Simulate);
}

}  // namespace cairn::client
