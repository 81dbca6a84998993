#include "server/robots/robots_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, RobotsOptions& options) {
  visitor.Integer(
      "max_robots", options.max_robots, "", 1, 4096,
      ForOperators("Robots that may be served at one time. When there are more, the session that ended first "
                   "is forgotten, then the one whose robot has been away for longest (at least for place_kept_s); "
                   "then further robots are refused. Each one takes the memory of an estimator."));
  visitor.Integer("queue_scans", options.queue_scans, "scans", 4, 4096,
                  "Scans of a robot that may wait. When the queue is full, the oldest scan is dropped. A "
                  "longer queue survives longer interruptions, and poses come later after one.");
  visitor.Integer("queue_odometry", options.queue_odometry, "samples", 16, 65536,
                  "Odometry samples of a robot that may wait. When the queue is full, the two oldest become one, so "
                  "that no motion is lost.");
  visitor.Integer("max_path_poses", options.max_path_poses, "poses", 1024, 100000000,
                  "Poses of a robot that are remembered, 104 bytes each. When there are more, every second "
                  "pose of the older half is removed.");
  visitor.Integer(
      "max_unclaimed", options.max_unclaimed, "streams", 1, 65536,
      "Streams of unknown robots that are counted one by one. The messages of further streams are counted together.");
  visitor.Integer(
      "max_earlier", options.max_earlier, "sessions", 0, 4096,
      "Ended sessions that are kept of robots that have begun another one or stayed away, so that what they saw can be "
      "joined with what is seen now. When there are more, the oldest is forgotten; its part of the map stays "
      "as it is. Each one takes the memory of an estimator, and smoothing jobs take longer.");
  visitor.Real(
      "suspended_expiry_s", options.suspended_expiry_s, "s", 1.0, 1e8,
      ForOperators("A session whose robot stays away for longer than this is ended, at the earliest an hour after the "
                   "server was started. With a longer time robots "
                   "may come back later, and vanished ones take memory for longer. A session that ended so "
                   "long ago is not shown any more and counts for max_earlier."));
  visitor.Real(
      "place_kept_s", options.place_kept_s, "s", 0.0, 1e8,
      "A robot that is away, also because the server was started again, keeps its place for at least this long "
      "when robots.max_robots are served and another one wants to begin.");
  visitor.Real("ledger_rate_hz", options.ledger_rate_hz, "Hz", 0.1, 100.0,
               "How often the counters of a robot are published while scans arrive. They are published at once after "
               "every eight scans and when its queue becomes empty.");
  visitor.Integer(
      "checkpoint_entries", options.checkpoint_entries, "entries", 10, 1000000000,
      "Entries of a robot's journal, mostly scans and odometry samples, after which a checkpoint is written. With a "
      "larger value less is written, and a server that starts again has more samples to process again.");
  visitor.Real("checkpoint_work_s", options.checkpoint_work_s, "s", 0.001, 1e6,
               "Processor time spent on a robot's samples after which a checkpoint is written, also before "
               "checkpoint_entries. A server that starts again needs up to this time for each robot once more. Where "
               "checkpoints of a robot take long to make, there are fewer: about a twentieth of its time at most.");
  visitor.Real(
      "gap_wait_s", options.gap_wait_s, "s", 0.1, 3600.0,
      "After a restart a robot sends again the samples that were not stored. For this long the server accepts no "
      "later samples of the robot. Then it accepts them, and counts the missing ones as lost.");
}

}  // namespace cairn::server
