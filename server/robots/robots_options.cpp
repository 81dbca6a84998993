#include "server/robots/robots_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, RobotsOptions& options) {
  visitor.Integer("max_robots", options.max_robots, "", 1, 4096, "Sessions at one time; more are refused.");
  visitor.Integer("queue_scans", options.queue_scans, "scans", 4, 4096,
                  "Scans waiting per robot; when full the oldest is dropped (queue_full).");
  visitor.Integer("queue_odometry", options.queue_odometry, "samples", 16, 65536,
                  "Odometry waiting per robot; when full the two oldest become one, so no motion is lost.");
  visitor.Integer("max_path_poses", options.max_path_poses, "poses", 1024, 100000000,
                  "Poses remembered per session; beyond, the older half is thinned to every second pose.");
  visitor.Integer("max_unclaimed", options.max_unclaimed, "streams", 1, 65536,
                  "Streams without a session that are counted one by one; more are counted together.");
  visitor.Real("ledger_rate_hz", options.ledger_rate_hz, "Hz", 0.1, 100.0,
               "Ledgers published per stream; every 8 settled scans and every drained queue publish at once.");
  visitor.Real("landmark_rate_hz", options.landmark_rate_hz, "Hz", 0.01, 20.0,
               "How often a session's landmarks are refreshed for queries.");
}

}  // namespace cairn::server
