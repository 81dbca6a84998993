// Where requests end up: questions are answered from snapshots on the desk's own thread, commands (submit, cancel, end,
// enable) are passed on to the room they concern. Bounded: when too many wait, the next is answered "busy" at once.
// Enabling a map version is answered when the switch is complete; nothing here waits for it.
// Thread rule: Take from any thread.
#pragma once

#include <functional>
#include <string>
#include <thread>

#include "common/bounded_channel.h"
#include "server/outbound.h"
#include "server/queries/views.h"

namespace cairn::server {

struct DeskPorts {
  Views views;
  std::function<Result<Job>(const std::string& site, JobKind kind, bool enable)> submit_job;
  std::function<Result<Job>(std::uint64_t id)> cancel_job;
  std::function<Result<void>(const std::string& robot)> end_session;
  // `done` gets the version enabled; called from any thread.
  std::function<void(const std::string& site, std::uint32_t version, std::function<void(Result<std::uint32_t>)> done)>
      enable_map;
};

class Desk {
 public:
  Desk(std::size_t capacity, Outbound& outbound, DeskPorts ports);
  ~Desk();

  void Start();
  void Take(Request&& request);
  // Answers what waits, then returns.
  void Stop();

 private:
  void Serve(const Request& request);
  void EnableMap(const Request& request);

  Outbound& outbound_;
  const DeskPorts ports_;
  BoundedChannel<Request> requests_;
  std::jthread thread_;  // Last: it uses everything above.
};

}  // namespace cairn::server
