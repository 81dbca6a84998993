#include "server/jobs/jobs_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, JobsOptions& options) {
  visitor.Integer(
      "max_queued", options.max_queued, "jobs", 1, 1024,
      "Jobs that may wait: so many that may change maps, and so many that only look for a robot. Further ones "
      "are refused.");
  visitor.Integer(
      "max_kept", options.max_kept, "jobs", 2, 65536,
      "Jobs whose state is remembered, waiting and running ones included. The oldest finished job is forgotten first.");
  visitor.Integer("nice", options.nice, "", 0, 19,
                  "Priority of the threads that run jobs, as for the command nice. A larger value leaves "
                  "more time to the robots, and jobs take longer.");
  visitor.Real("snapshot_timeout_s", options.snapshot_timeout_s, "s", 0.1, 600.0,
               "A job fails if a robot has not handed over its state within this time.");
  visitor.Flag(
      "joint", options.joint,
      "Whether a smoothing job also looks for places that several robots of the site have seen, and smooths all "
      "robots together. This takes one to three seconds per hundred metres of way and per pair of robots.");
  visitor.Flag("join", options.join,
               "Whether robots that have not said where they start in a site with a map are joined with this map by "
               "themselves, as soon as they have seen enough of the same places. Otherwise a smoothing job joins them. "
               "Has no effect unless `joint` is true.");
  visitor.Real("join_way_m", options.join_way_m, "m", 1.0, 1e5,
               "How far such a robot, and the others of the site together, must have driven before it is tried for the "
               "first time. It is tried again whenever it or they have driven a tenth more, or one of them 200 m.");
  visitor.Flag(
      "align", options.align,
      "Whether robots that have said where they start are fitted to each other by themselves, when two of them "
      "have driven `join_way_m` and whenever all have driven a quarter more, or one of them 200 m. A map version is "
      "made and enabled only if it moves something by more than a cell and agrees better, and never in place of one "
      "that a person has chosen. Has no effect unless `joint` is true.");
  visitor.Flag("check_starts", options.check_starts,
               "Whether a robot whose first metres contradict what others have drawn there is taken for one that has "
               "not said where it starts.");
  visitor.Real("relocalise_after_s", options.relocalise_after_s, "s", 0.0, 1e5,
               "How long a robot must have been lost before it is looked for in the whole map of its site, and not in "
               "its own one alone. If it is not found, it is looked for again after twice that time, and so on. 0: "
               "only when somebody asks.");
  visitor.Require(2 * options.max_queued + 2 <= options.max_kept, "max_queued", "must be below half of", "max_kept");
}

}  // namespace cairn::server
