// One robot's session as a source of scans: sends through a RobotClient, measures the time from a scan's publication to
// the pose that answers it, and accounts for every scan by the server's ledger.
// Thread rule: one sending thread; the server's answers arrive on the wire's threads.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/percentiles.h"
#include "client/cli/program.h"
#include "client/cli/scan_account.h"
#include "client/lib/robot_client.h"
#include "common/sensor/log_record.h"

namespace cairn::client {

struct StreamOptions {
  std::string robot;
  std::string site;
  std::vector<std::string> sensors = {"laser"};  // Its lidars; at least one.
  std::optional<Pose2> T_map_robot_start;
  // The largest number of scans sent and not yet settled: beyond it, sending waits for the server. 0: no limit; the
  // server drops scans that come too fast.
  std::uint64_t window = 0;
  bool measure_latency = true;  // Not useful if a scan first waits for room in the window.
  std::string spill_file = {};  // For samples that have to wait for the server, beyond what fits into memory.
};

class RobotStream {
 public:
  // Opens the session; fails if no server answers or it refuses the robot. `program` outlives the stream.
  [[nodiscard]] static Result<std::unique_ptr<RobotStream>> Open(Program& program, const StreamOptions& options);

  // Waits for room in the window; fails if the server settles nothing within the program's timeout, says that it
  // stops, or has been away for that long.
  // `lidar`: of a scan, its place in `sensors`.
  [[nodiscard]] Result<void> Send(LogRecord&& record, std::size_t lidar = 0);
  // Waits until everything sent is settled and then until it is stored, each at most for the program's timeout:
  // account() tells what is left.
  void Settle();
  // Ends the session for good.
  [[nodiscard]] Result<void> End();

  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  [[nodiscard]] ScanAccount account() const;
  // New sessions that a server which had lost the one before made necessary.
  [[nodiscard]] int restarted() const;
  [[nodiscard]] int renewed() const { return client_->renewed(); }  // Times it joined the domain anew.
  [[nodiscard]] std::uint64_t displaced() const { return client_->displaced(); }
  [[nodiscard]] std::string spill_error() const { return client_->spill_error(); }
  // Publication to pose, milliseconds.
  [[nodiscard]] Percentiles latency_ms() const;

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kRemembered = 4096;  // Scans whose time of sending is kept.

  struct Departure {
    Stamp stamp = 0;
    Clock::time_point time;
    bool waiting = false;
  };

  RobotStream(const StreamOptions& options, double timeout_s)
      : options_(options), timeout_s_(timeout_s), before_(options.sensors.size()) {}
  [[nodiscard]] Result<std::vector<Ledger>> AskLedgers(Program& program) const;  // By sensor.
  void OnPose(const PoseReport& pose);
  void OnRestart(SessionToken session);
  [[nodiscard]] Departure& DepartureOf(Stamp stamp);
  [[nodiscard]] ScanAccount AccountOfSession(std::uint64_t sent) const;
  [[nodiscard]] Result<void> CheckServer();

  const StreamOptions options_;
  const double timeout_s_;
  std::uint64_t sent_ = 0;
  Clock::time_point connected_ = Clock::now();  // The last time at which a server was connected.

  mutable std::mutex mutex_;
  SessionToken session_ = 0;
  // The ledgers before the session's first scan, by sensor; not zero if a session is resumed.
  std::vector<Ledger> before_;
  ScanAccount closed_;  // The counts of sessions that a restarted server did not know.
  int restarted_ = 0;
  std::array<Departure, kRemembered> departures_{};
  Percentiles latency_ms_;

  std::unique_ptr<RobotClient> client_;  // Last: its callbacks use everything above.
};

// The option that bounds how far a stream may run ahead of the server. With a window below 64, the length of the
// server's queue, no scan is lost.
inline constexpr std::uint64_t kFastWindow = 32;

inline void AddWindowOption(CLI::App& command, std::uint64_t& window) {
  command
      .add_option(
          "--window", window,
          "Most scans sent and not yet answered [with --fast: 32]; a stream that is too fast for the server waits "
          "instead of losing scans")
      ->check(CLI::Range(1, 48));
}

}  // namespace cairn::client
