// Options of the server's background jobs.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct JobsOptions {
  std::int64_t max_queued = 16;
  std::int64_t max_kept = 256;
  std::int64_t nice = 10;
  double snapshot_timeout_s = 10;
  bool joint = true;
  bool join = true;
  double join_way_m = 20;
  bool align = true;
  bool check_starts = true;
  double relocalise_after_s = 10;
};
void Visit(OptionVisitor& visitor, JobsOptions& options);

}  // namespace cairn::server
