#include "client/cli/sim_run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "client/cli/interrupt.h"
#include "client/cli/pacer.h"
#include "client/cli/progress_line.h"
#include "client/cli/robot_stream.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/carmen_writer.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

// One robot's outlets: its stream, its log, or both.
struct Outlet {
  std::string robot;
  std::unique_ptr<RobotStream> stream;
  std::ofstream log;
  std::unique_ptr<CarmenWriter> writer;
  Pose2 T_odom_robot;
  bool closed = false;  // The odometry after its last scan has been sent.

  Result<void> Take(LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) T_odom_robot = odometry->T_odom_robot;
    if (writer) {
      if (const auto* odometry = std::get_if<Odometry>(&record)) writer->Write(*odometry);
      if (const auto* scan = std::get_if<Scan>(&record)) writer->Write(*scan, T_odom_robot);
    }
    return stream ? stream->Send(std::move(record)) : Result<void>{};
  }
};

Result<void> MakeDirectory(const std::string& path) {
  if (path.empty()) return {};
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return Fail(StatusCode::kUnavailable, path + ": " + error.message());
  return {};
}

Result<std::vector<Outlet>> OpenOutlets(Program& program, const SimRunOptions& options, const sim::Fleet& fleet) {
  std::vector<Outlet> outlets(static_cast<std::size_t>(fleet.robots()));
  for (int i = 0; i < fleet.robots(); ++i) {
    Outlet& outlet = outlets[static_cast<std::size_t>(i)];
    outlet.robot = options.prefix + std::to_string(i + 1);
    if (!options.log_dir.empty()) {
      const std::string path = options.log_dir + "/" + outlet.robot + ".log";
      outlet.log.open(path);
      if (!outlet.log) return Fail(StatusCode::kUnavailable, path + ": cannot be written");
      outlet.writer = std::make_unique<CarmenWriter>(outlet.log);
    }
    if (!options.stream) continue;
    StreamOptions stream{outlet.robot, options.site, {"laser"}, std::nullopt, options.window, !options.fast};
    if (options.starts_known) stream.T_map_robot_start = fleet.T_map_robot_start(i);
    if (options.fast && options.window == 0) stream.window = kFastWindow;
    auto opened = RobotStream::Open(program, stream);
    if (!opened) return tl::unexpected(opened.error());
    outlet.stream = std::move(*opened);
  }
  return outlets;
}

// Sends until `seconds` of simulated time have passed and every robot's last scan has odometry after it.
Result<void> Stream(Program& program, const SimRunOptions& options, sim::Fleet& fleet, std::vector<Outlet>& outlets) {
  Pacer pacer(options.fast || !options.stream ? 0.0 : options.rate);
  ProgressLine progress(program.err(), ErrorIsTerminal(), program.options.json);
  const auto start = Clock::now();
  const Stamp end = options.fleet.first_stamp + StampFromSeconds(options.seconds);
  std::size_t closed = 0;
  std::uint64_t scans = 0;
  double simulated_s = 0.0;
  const auto text = [&] {
    return fmt::format("{:.1f} of {:g} s, {} robots, {} scans", simulated_s, options.seconds, outlets.size(), scans);
  };
  while (closed < outlets.size() && !Interrupted()) {
    sim::FleetRecord next = fleet.Next();
    const Stamp stamp = std::visit([](const auto& value) { return value.stamp; }, next.record);
    Outlet& outlet = outlets[static_cast<std::size_t>(next.robot)];
    const bool is_scan = std::holds_alternative<Scan>(next.record);
    if (outlet.closed || (is_scan && stamp >= end)) continue;
    pacer.WaitFor(stamp);
    if (stamp >= end) {
      outlet.closed = true;
      ++closed;
    }
    scans += is_scan;
    if (auto taken = outlet.Take(std::move(next.record)); !taken) return taken;
    simulated_s = SecondsFromStamp(std::min(stamp, end) - options.fleet.first_stamp);
    progress.Show(std::chrono::duration<double>(Clock::now() - start).count(), simulated_s / options.seconds, text());
  }
  progress.Finish(std::chrono::duration<double>(Clock::now() - start).count(), simulated_s / options.seconds, text());
  if (Interrupted()) return Fail(StatusCode::kCancelled, "interrupted");
  return {};
}

Result<void> WriteTruth(const SimRunOptions& options, const sim::Fleet& fleet, const std::vector<Outlet>& outlets) {
  if (options.truth_dir.empty()) return {};
  const Stamp end = options.fleet.first_stamp + StampFromSeconds(options.seconds);
  for (int i = 0; i < fleet.robots(); ++i) {
    Trajectory truth = fleet.truth(i);
    truth.erase(std::find_if(truth.begin(), truth.end(), [end](const StampedPose& pose) { return pose.stamp >= end; }),
                truth.end());
    const auto path = options.truth_dir + "/" + outlets[static_cast<std::size_t>(i)].robot + ".tum";
    if (auto written = WriteTum(truth, path); !written) return written;
  }
  return {};
}

}  // namespace

bool SimReport::explained() const {
  return std::all_of(robots.begin(), robots.end(),
                     [](const SimRobotReport& robot) { return robot.account.unexplained() == 0; });
}

Result<SimReport> RunSim(Program& program, const SimRunOptions& options) {
  auto world = sim::OpenSurroundings(options.world);
  if (!world) return tl::unexpected(world.error());
  auto fleet = sim::Fleet::Create(std::move(*world), options.fleet);
  if (!fleet) return tl::unexpected(fleet.error());
  for (const std::string& directory : {options.truth_dir, options.log_dir}) {
    if (auto made = MakeDirectory(directory); !made) return tl::unexpected(made.error());
  }
  auto outlets = OpenOutlets(program, options, *fleet);
  if (!outlets) return tl::unexpected(outlets.error());

  const auto cpu_before = CpuSecondsOf(options.watched_pid);
  const auto start = Clock::now();
  if (auto streamed = Stream(program, options, *fleet, *outlets); !streamed) return tl::unexpected(streamed.error());
  SimReport report;
  report.simulated_s = options.seconds;
  report.took_s = std::chrono::duration<double>(Clock::now() - start).count();
  if (const auto cpu_after = CpuSecondsOf(options.watched_pid); cpu_before && cpu_after) {
    report.watched_cpu_share = (*cpu_after - *cpu_before) / report.took_s;
  }

  Percentiles latency_ms;
  for (std::size_t i = 0; i < outlets->size(); ++i) {
    Outlet& outlet = (*outlets)[i];
    SimRobotReport robot;
    robot.robot = outlet.robot;
    robot.T_map_robot_start = fleet->T_map_robot_start(static_cast<int>(i));
    if (outlet.stream) {
      outlet.stream->Settle();
      if (options.end) {
        if (auto ended = outlet.stream->End(); !ended) return tl::unexpected(ended.error());
      }
      robot.account = outlet.stream->account();
      const Percentiles own = outlet.stream->latency_ms();
      robot.latency_p50_ms = own.At(0.5);
      robot.latency_p99_ms = own.At(0.99);
      latency_ms.Add(own);
    }
    report.robots.push_back(robot);
  }
  report.latency_p50_ms = latency_ms.At(0.5);
  report.latency_p99_ms = latency_ms.At(0.99);
  report.latency_max_ms = latency_ms.At(1.0);
  if (auto written = WriteTruth(options, *fleet, *outlets); !written) return tl::unexpected(written.error());
  return report;
}

std::optional<double> CpuSecondsOf(int pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string line;
  if (!std::getline(file, line)) return std::nullopt;
  // The second field is the name in parentheses and may hold spaces; utime and stime are the 14th and 15th (proc(5)).
  const auto name_end = line.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream fields(line.substr(name_end + 1));
  std::string skipped;
  for (int i = 3; i < 14; ++i) fields >> skipped;
  double user = 0.0, system = 0.0;
  if (!(fields >> user >> system)) return std::nullopt;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace cairn::client
