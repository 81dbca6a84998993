#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/lidar_names.h"
#include "client/cli/option_checks.h"
#include "client/cli/pacer.h"
#include "client/cli/progress_line.h"
#include "client/cli/quantity_text.h"
#include "client/cli/robot_stream.h"
#include "common/bag/recording.h"
#include "common/sensor/log_options.h"
#include "common/service/start_pose.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

struct ReplayArguments {
  std::string log;
  std::string sensor;  // Empty: `laser`, or for several lidars the names of their topics.
  LogReaderOptions reader = {.all_lidars = true};
  StreamOptions stream;
  double rate = 1.0;
  bool fast = false;
  bool end = false;
};

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Reads the log and streams it; `total` scans are expected, for the progress bar.
Result<LogSummary> StreamLog(Program& program, const ReplayArguments& arguments, RobotStream& stream, int total,
                             Clock::time_point start) {
  Pacer pacer(arguments.fast ? 0.0 : arguments.rate);
  ProgressLine progress(program.err(), ErrorIsTerminal(), program.options.json);
  const auto show = [&](auto&& draw) {
    const ScanAccount account = stream.account();
    const double seconds = SecondsSince(start);
    draw(seconds, static_cast<double>(stream.sent()) / std::max(1, total),
         fmt::format("{} of {} scans, {:.0f}/s, used {}, dropped {}, waiting {}", stream.sent(), total,
                     static_cast<double>(stream.sent()) / std::max(1e-3, seconds), account.used,
                     account.dropped_total(), account.waiting));
  };
  Result<void> sent;
  auto summary = ReadLidars(arguments.log, arguments.reader, [&](LogRecord&& record, std::size_t lidar) {
    pacer.WaitFor(std::visit([](const auto& value) { return value.stamp; }, record));
    if (Interrupted()) return false;
    sent = stream.Send(std::move(record), lidar);
    show([&](double s, double share, const std::string& text) { progress.Show(s, share, text); });
    return sent.has_value();
  });
  if (summary && sent) stream.Settle();
  show([&](double s, double share, const std::string& text) { progress.Finish(s, share, text); });
  if (!sent) return tl::unexpected(sent.error());
  return summary;
}

// The effects of a server that was not reachable for a while.
std::string FormatInterruptions(const RobotStream& stream) {
  std::string text;
  if (stream.renewed() > 0) {
    text += fmt::format("the stream stood still and was made anew {} times\n", stream.renewed());
  }
  if (stream.restarted() > 0) {
    text += fmt::format("the server lost the session {} times; a new session continued at the robot's pose\n",
                        stream.restarted());
  }
  if (stream.displaced() > 0) {
    text += fmt::format("{} samples were dropped, because too many waited for the server{}{}\n", stream.displaced(),
                        stream.spill_error().empty() ? "" : ": ", stream.spill_error());
  }
  return text;
}

ExitCode Replay(Program& program, const ReplayArguments& arguments) {
  // The log is read once without sending: a file that cannot be read must not open a session, and the progress line
  // needs the number of scans.
  const auto survey = ReadRecording(arguments.log, arguments.reader, [](LogRecord&&) { return !Interrupted(); });
  if (!survey) return program.Refuse(survey.error());
  if (survey->scans == 0) return program.Refuse({StatusCode::kInvalidArgument, arguments.log + " holds no scan"});
  StreamOptions options = arguments.stream;
  if (survey->lidars.size() > 1) {
    if (!arguments.sensor.empty())
      return program.Refuse({StatusCode::kInvalidArgument, "--sensor names one lidar, and " + arguments.log + " has " +
                                                               std::to_string(survey->lidars.size())});
    options.sensors = LidarNames(survey->lidars);
  } else if (!arguments.sensor.empty()) {
    options.sensors = {arguments.sensor};
  }
  if (arguments.fast && options.window == 0) options.window = kFastWindow;
  options.measure_latency = !arguments.fast;
  auto stream = RobotStream::Open(program, options);
  if (!stream) return program.Refuse(stream.error());

  const auto start = Clock::now();
  const auto summary = StreamLog(program, arguments, **stream, survey->scans, start);
  if (arguments.end) {
    if (const auto ended = (*stream)->End(); !ended) return program.Refuse(ended.error());
    (*stream)->Settle();
  }
  const ScanAccount account = (*stream)->account();
  const Percentiles latency = (*stream)->latency_ms();
  const double seconds = SecondsSince(start);
  std::string text = fmt::format("{}: {}\n", options.robot, FormatAccount(account));
  text += fmt::format("took {}, {:.0f} scans/s", FormatDuration(seconds), static_cast<double>(account.sent) / seconds);
  if (latency.count() > 0) {
    text += fmt::format(", scan to pose p50 {:.1f} ms, p99 {:.1f} ms", latency.At(0.5), latency.At(0.99));
  }
  text += "\n";
  if (survey->complaint_count > 0) {
    text += fmt::format("{} {}s could not be read, the first: {} {}: {}\n", survey->complaint_count, survey->entry,
                        survey->entry, survey->complaints.front().line, survey->complaints.front().reason);
  }
  text += FormatInterruptions(**stream);
  nlohmann::json object = account;
  object.update({{"robot", options.robot},
                 {"site", options.site},
                 {"seconds", seconds},
                 {"restarted", (*stream)->restarted()},
                 {"renewed", (*stream)->renewed()},
                 {"displaced", (*stream)->displaced()},
                 {"complaint_count", survey->complaint_count}});
  if (latency.count() > 0) {
    object.update({{"pose_latency_p50_ms", latency.At(0.5)}, {"pose_latency_p99_ms", latency.At(0.99)}});
  }
  Status status = summary ? Status{} : summary.error();
  if (status.ok() && !Interrupted() && account.unexplained() != 0)
    status = {StatusCode::kDataLoss, std::to_string(account.unexplained()) + " scans are not in the server's account"};
  if (!status.ok()) object["error"] = status;
  program.Print(text, object);
  if (!status.ok())
    program.err() << "cairn: " << status.message << " (" << StatusCodeName(status.code) << ")\n";
  else if (account.used == 0)
    program.err() << "cairn: no scan was used\n";
  return status.ok() && !Interrupted() ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace

void AddReplay(CLI::App& app, Program& program) {
  auto* command =
      app.add_subcommand("replay", "Stream a robot log or bag to the server, as if the robot were driving now");
  command->footer(
      "Reads CARMEN logs (ODOM, FLASER, RLASER, ROBOTLASER1, RAWLASER1), DP-SLAM logs, bags of ROS 2 (a folder "
      "with\n"
      "metadata.yaml, or one .mcap or .db3 file), and what `cairn record` writes. With --fast the log is sent\n"
      "as fast as the server takes it: at most --window scans wait for an answer, so that none is lost. The summary\n"
      "says how many scans the server used, and how many it dropped for which reason.\n"
      "Exit code 1 if the server cannot say what became of a scan.\n"
      "EXAMPLES\n  cairn replay intel.clf --site intel --robot r1 --fast\n"
      "  cairn replay run.log --site hall --robot r2 --rate 2 --start 1.5,-2,90deg\n"
      "  cairn replay rosbag2_2024_05_13/ --site hall --robot r3 --scan-topic /scan_front");
  auto arguments = std::make_shared<ReplayArguments>();
  command->add_option("log", arguments->log, "The log file, or the bag")->required()->type_name("FILE");
  command->add_option("--site", arguments->stream.site, "The site to map into")->required();
  command->add_option("--robot", arguments->stream.robot, "The robot's name")->required();
  command->add_option("--sensor", arguments->sensor,
                      "The scanner's name [laser]; several lidars of a bag have the names of their topics");
  auto* rate = AddNumber(*command, "--rate", arguments->rate, 1e-3, 1e6, "How many times faster than the log's stamps");
  command->add_flag("--fast", arguments->fast, "As fast as the server takes it, without losing a scan")->excludes(rate);
  AddWindowOption(*command, arguments->stream.window);
  AddParsed(*command, "--start", arguments->stream.T_map_robot_start, ParseStart,
            "Where the robot stands in the map when the log begins", "X,Y,THETA");
  command
      ->add_option("--spill", arguments->stream.spill_file,
                   "A new file for samples beyond 64 MiB that wait for a server; deleted at the end")
      ->type_name("FILE");
  command->add_flag("--end", arguments->end, "End the session afterwards; without this it can be resumed");
  AddLogOptions(*command, arguments->reader);
  program.OnChosen(*command, arguments, Replay);
}

}  // namespace cairn::client
