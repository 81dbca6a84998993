// How much work on the side the server takes.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct JobsOptions {
  std::int64_t max_queued = 16;    // Waiting; more are refused (RESOURCE_EXHAUSTED).
  std::int64_t max_kept = 256;     // Jobs remembered; the oldest finished one is forgotten first.
  double progress_rate_hz = 5.0;   // Progress published per job.
  std::int64_t nice = 10;          // Of the worker thread: higher yields more to streaming, and jobs take longer.
  double snapshot_timeout_s = 10;  // A robot that has not shown its state to a job by then fails the job.
};
void Visit(OptionVisitor& visitor, JobsOptions& options);

}  // namespace cairn::server
