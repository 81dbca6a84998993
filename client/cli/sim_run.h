// Streams a simulated fleet into one site: paces it, keeps the truth, and reports what became of every scan.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/program.h"
#include "client/cli/scan_account.h"
#include "client/sim/fleet.h"

namespace cairn::client {

struct SimRunOptions {
  std::string world = "building";
  std::string site;
  std::string prefix = "robot";  // Robots are called prefix1, prefix2, ...
  sim::FleetOptions fleet;
  double seconds = 60.0;  // Simulated time.
  double rate = 1.0;
  bool fast = false;
  std::uint64_t window = 0;  // Unsettled scans per robot, at most; 0: no limit, or kFastWindow with `fast`.
  bool stream = true;        // False: no server; only the files are written.
  bool starts_known = true;  // Whether the robots say where they start.
  bool end = false;
  std::string truth_dir;  // <robot>.tum: true poses at the scans' stamps.
  std::string log_dir;    // <robot>.log: CARMEN logs of what was streamed.
  int watched_pid = 0;    // The process whose processor time is reported; 0: none.
};

struct SimRobotReport {
  std::string robot;
  Pose2 T_map_robot_start;
  ScanAccount account;
  double latency_p50_ms = 0.0;
  double latency_p99_ms = 0.0;
};

struct SimReport {
  std::vector<SimRobotReport> robots;
  double simulated_s = 0.0;
  double took_s = 0.0;
  double latency_p50_ms = 0.0;  // Over all robots.
  double latency_p99_ms = 0.0;
  double latency_max_ms = 0.0;              // The longest pause any robot saw.
  std::optional<double> watched_cpu_share;  // 1: one core, all the time.

  [[nodiscard]] double rate() const { return took_s > 0.0 ? simulated_s / took_s : 0.0; }
  [[nodiscard]] bool explained() const;
};

[[nodiscard]] Result<SimReport> RunSim(Program& program, const SimRunOptions& options);

// The processor time that a process has used, read from /proc; load tests print it for the server. Seconds of all its
// threads, user and system; nothing if there is no such process.
[[nodiscard]] std::optional<double> CpuSecondsOf(int pid);

// The options of `cairn sim` that say what the robots carry: laser, tilting mount, wheels.
void AddSensorOptions(CLI::App& command, sim::FleetOptions& fleet);

}  // namespace cairn::client
