// How many robots the server takes and how much it holds for each.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct RobotsOptions {
  std::int64_t max_robots = 256;
  std::int64_t queue_scans = 64;
  std::int64_t queue_odometry = 1024;
  std::int64_t max_path_poses = 131072;
  std::int64_t max_unclaimed = 256;
  std::int64_t max_earlier = 32;
  double suspended_expiry_s = 86400.0;
  double place_kept_s = 60.0;
  double ledger_rate_hz = 10.0;
  double gap_wait_s = 10.0;
  std::int64_t checkpoint_entries = 2500;
  double checkpoint_work_s = 0.2;
};
void Visit(OptionVisitor& visitor, RobotsOptions& options);

}  // namespace cairn::server
