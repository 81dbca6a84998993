// The whole tree of the server's options, as `--print-config` shows it. Everything has a default that works.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/jobs/jobs_options.h"
#include "server/maps/maps_options.h"
#include "server/ops/logging.h"
#include "server/robots/robots_options.h"
#include "server/slam/mapper_options.h"

namespace cairn::server {

// The server as a process.
struct ProcessOptions {
  LogLevel log_level = LogLevel::kInfo;
  std::int64_t threads = 0;              // For the robots' estimators; 0: one per core.
  std::string sites;                     // Comma-separated; made at start.
  bool create_sites = true;              // A robot may name a site that does not exist yet.
  std::int64_t inbound_capacity = 8192;  // Values between the doors and the rooms.
  std::int64_t outbound_capacity = 4096;
  std::int64_t query_queue = 256;  // Requests waiting; more are answered "busy".
  double stop_timeout_s = 1.5;     // For finishing accepted scans after SIGTERM; what is left is dropped and counted.
  double stall_limit_s = 5.0;      // A strand silent for longer stops the watchdog's pings.

  [[nodiscard]] std::vector<std::string> site_names() const;
};

struct ServerOptions {
  ProcessOptions server;
  slam::MapperOptions slam;
  RobotsOptions robots;
  MapsOptions maps;
  JobsOptions jobs;
};
void Visit(OptionVisitor& visitor, ServerOptions& options);

}  // namespace cairn::server
