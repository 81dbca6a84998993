// All options of the server, as `--print-config` shows them. Every option has a default that works.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/jobs/jobs_options.h"
#include "server/maps/maps_options.h"
#include "server/ops/logging.h"
#include "server/robots/robots_options.h"
#include "server/slam/mapper_options.h"
#include "server/store/store_options.h"

namespace cairn::server {

// Options of the server process.
struct ProcessOptions {
  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;
  std::int64_t threads = 0;
  std::string sites;
  bool create_sites = true;
  std::int64_t inbound_capacity = 8192;
  std::int64_t outbound_capacity = 4096;
  std::int64_t query_queue = 256;
  double stop_timeout_s = 1.5;
  double stall_limit_s = 5.0;

  [[nodiscard]] std::vector<std::string> site_names() const;
};

struct ServerOptions {
  ProcessOptions server;
  slam::MapperOptions slam;
  RobotsOptions robots;
  MapsOptions maps;
  JobsOptions jobs;
  StoreOptions store;
};
void Visit(OptionVisitor& visitor, ServerOptions& options);

}  // namespace cairn::server
