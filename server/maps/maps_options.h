// Options of the joint maps: how often they are published, how many versions and edits are kept, how much memory they
// may take, and how much the past counts.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct MapsOptions {
  double publish_rate_hz = 2.0;
  std::int64_t max_sites = 64;
  std::int64_t max_versions = 8;
  double past_probability = 0.8;
  std::int64_t max_edits = 256;
  double max_memory_mib = 0.0;        // Of each site; 0: no limit.
  double max_total_memory_mib = 0.0;  // Of all sites together; 0: no limit.
};
void Visit(OptionVisitor& visitor, MapsOptions& options);

}  // namespace cairn::server
