// The server, and the only file that includes every room. It makes the rooms, passes references between them,
// and runs two threads of its own. The dispatcher takes values from the inbound channel and gives each to its
// room. Housekeeping publishes what is due and checks that every strand makes progress. The rooms publish
// through the outbound lanes. The server does not depend on DDS: Ingress and Egress are at the other ends of
// the two channels, so tests can run the whole server without them. The other threads are listed in
// server/README.md. Thread rule: Start and Stop from one thread; the rest from any.
#pragma once

#include <asio/thread_pool.hpp>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <thread>
#include <utility>

#include "server/inbound.h"
#include "server/jobs/job_worker.h"
#include "server/jobs/joiner.h"
#include "server/jobs/lost_robots.h"
#include "server/jobs/relocalise_job.h"
#include "server/jobs/smooth_job.h"
#include "server/jobs/start_check.h"
#include "server/maps/atlas.h"
#include "server/ops/heartbeat.h"
#include "server/ops/start_control.h"
#include "server/options.h"
#include "server/outbound.h"
#include "server/queries/desk.h"
#include "server/robots/roster.h"

namespace cairn::server {

class Server {
 public:
  // `generation`: the number of this start of the server, the same as that of the egress.
  // `journal` stores the state and contains that of earlier servers; null: nothing is stored. The caller stops it after
  // the server. `saved`: the directory of saved sites; empty: none are kept.
  Server(const ServerOptions& options, Inbound& inbound, Outbound& outbound, Generation generation,
         Journal* journal = nullptr, const std::filesystem::path& saved = {});
  ~Server();

  // Restores what is stored, creates the configured sites and starts the threads. `control` tells other threads how it
  // goes on; CANCELLED if it was given up, after which the server can only be destroyed.
  Result<void> Start(StartControl& control);
  Result<void> Start() {
    StartControl control;
    return Start(control);
  }
  // Accepts no more values and finishes the accepted ones within server.stop_timeout_s; the rest is dropped
  // and counted. Then it publishes the last state of every session and closes the outbound lanes.
  void Stop();

  // False if a thread or strand that has work, or the middleware, has finished nothing for server.stall_limit_s, or if
  // nobody has looked for so long.
  [[nodiscard]] bool healthy() const;
  // What `cairn status` says of refused peers.
  void SetRefusals(const Refusals& refusals) { desk_.SetRefusals(refusals); }
  // What `cairn status` says of how busy the server is.
  void SetLoad(const ServerLoad& load) { desk_.SetLoad(load); }
  // How long the robots' work has waited for a thread.
  [[nodiscard]] DelayMeter::Quantiles robot_waits() const { return roster_.waits(); }
  // For how long the middleware has been busy with one datagram. It counts for `healthy`, because nothing can arrive
  // meanwhile, not even a question.
  void SetReceiving(std::chrono::nanoseconds busy_with_one) { receiving_ns_ = busy_with_one.count(); }
  // What `cairn ros2 doctor` says.
  void SetRos2(Ros2Report&& report) { desk_.SetRos2(std::move(report)); }
  // How many maps robots are localised in, in memory: those that are localised in the same one share it.
  [[nodiscard]] std::size_t known_maps() const { return roster_.known_grids().size(); }
  // Scans of streams without a session, beyond the first robots.max_unclaimed streams. They are in no ledger.
  [[nodiscard]] std::uint64_t uncounted_scans() const { return roster_.unclaimed_overflow(); }

 private:
  void Dispatch(const std::stop_token& stop);
  void KeepHouse(const std::stop_token& stop);
  Result<void> Restore(StartControl& control);
  void CheckHealth();
  void CheckJournal();
  void FinishSessions();

  const ServerOptions options_;
  Inbound& inbound_;
  Outbound& outbound_;
  Journal* const journal_;

  // The pools are declared first: sessions and sites hold strands of the pools and must be destroyed before
  // them.
  asio::thread_pool robots_pool_;
  asio::thread_pool maps_pool_;
  Atlas atlas_;
  Roster roster_;
  JobList jobs_;
  SmoothJob smooth_;  // Used by the worker's thread that may change maps only.
  const RelocaliseJob relocalise_;
  JobWorker worker_;
  // Used by housekeeping only.
  Joiner joiner_;
  StartCheck start_check_;
  LostRobots lost_robots_;
  SavedSites saved_sites_;
  Desk desk_;
  Heartbeat heartbeat_;
  bool journal_degraded_ = false, over_budget_ = false;  // As last logged.
  std::atomic<bool> healthy_{true};
  std::atomic<std::chrono::steady_clock::duration> looked_at_;  // Of the last CheckHealth, since the clock's beginning.
  std::atomic<std::int64_t> receiving_ns_{0};
  std::atomic<bool> stopping_{false};
  std::jthread housekeeping_;
  std::jthread dispatcher_;
};

}  // namespace cairn::server
