#include "server/jobs/jobs_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, JobsOptions& options) {
  visitor.Integer("max_queued", options.max_queued, "jobs", 1, 1024, "Jobs waiting; more are refused.");
  visitor.Integer("max_kept", options.max_kept, "jobs", 2, 65536,
                  "Jobs remembered; the oldest finished one is forgotten first.");
  visitor.Real("progress_rate_hz", options.progress_rate_hz, "Hz", 0.1, 50.0, "Progress published per job.");
  visitor.Integer("nice", options.nice, "", 0, 19,
                  "Priority of the worker thread: higher yields more to streaming, and jobs take longer.");
  visitor.Real("snapshot_timeout_s", options.snapshot_timeout_s, "s", 0.1, 600.0,
               "A robot that has not shown its state to a job by then fails the job.");
}

}  // namespace cairn::server
