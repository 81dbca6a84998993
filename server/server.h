// The server: the only file that knows every room. Takes plain values from the inbound channel, routes each to the room
// it concerns, and lets the rooms speak through the outbound lanes. Knows no DDS: the doors are at the other ends of
// the two channels, which is how tests run it whole. Threads: a dispatcher (routes, never works), a pool for the
// robots' strands, one thread for the site maps' strands, the desk's, the job worker's, and housekeeping (publishes
// what is due, feeds the watchdog). Thread rule: Start and Stop from one thread; the rest from any.
#pragma once

#include <asio/thread_pool.hpp>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "server/desk.h"
#include "server/inbound.h"
#include "server/jobs/job_worker.h"
#include "server/maps/atlas.h"
#include "server/ops/heartbeat.h"
#include "server/options.h"
#include "server/outbound.h"
#include "server/robots/roster.h"

namespace cairn::server {

class Server {
 public:
  Server(const ServerOptions& options, Inbound& inbound, Outbound& outbound);
  ~Server();

  // Makes the configured sites and starts the threads.
  Result<void> Start();
  // Takes nothing more, finishes what was accepted (within server.stop_timeout_s; what is left is dropped and counted),
  // says goodbye for every session and closes the outbound lanes.
  void Stop();

  // Every strand has answered within server.stall_limit_s.
  [[nodiscard]] bool healthy() const { return healthy_; }

 private:
  RosterPorts MakeRosterPorts();
  SitePorts MakeSitePorts();
  DeskPorts MakeDeskPorts();
  std::map<JobKind, JobWork> MakeJobWorks();

  void Dispatch(const std::stop_token& stop);
  void KeepHouse(const std::stop_token& stop);
  void CheckHealth();
  void FinishSessions();
  void PublishMaps();
  Result<std::vector<SessionMaterial>> CollectMaterial(const std::string& site, const JobControl& control);
  Result<std::uint32_t> AwaitMap(const std::string& site, const std::function<void(Site&, Site::Done)>& ask);

  const ServerOptions options_;
  Inbound& inbound_;
  Outbound& outbound_;

  // The pools come first: sessions and sites hold strands of them and must go before they do.
  asio::thread_pool robots_pool_;
  asio::thread_pool maps_pool_;
  Atlas atlas_;
  Roster roster_;
  JobList jobs_;
  JobWorker worker_;
  Desk desk_;
  Heartbeat heartbeat_;
  std::atomic<bool> healthy_{true};
  std::atomic<bool> stopping_{false};
  std::jthread housekeeping_;
  std::jthread dispatcher_;
};

}  // namespace cairn::server
