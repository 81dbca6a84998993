// How many robots the server takes and how much it holds for each.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct RobotsOptions {
  std::int64_t max_robots = 256;          // Sessions at one time; more are refused. Each costs an estimator's memory.
  std::int64_t queue_scans = 64;          // Scans waiting per robot; more: the oldest is dropped. Larger rides out
                                          // longer stalls, and poses come later when it happens.
  std::int64_t queue_odometry = 1024;     // Odometry waiting per robot; more: the two oldest become one.
  std::int64_t max_path_poses = 1000000;  // Poses remembered per session (32 bytes each); beyond, the older half is
                                          // thinned to every second pose.
  std::int64_t max_unclaimed = 256;       // Streams without a session that are counted one by one.
  double ledger_rate_hz = 10.0;           // Ledgers published per stream while nothing settles in bulk.
  double landmark_rate_hz = 2.0;          // Landmarks refreshed for queries.
};
void Visit(OptionVisitor& visitor, RobotsOptions& options);

}  // namespace cairn::server
