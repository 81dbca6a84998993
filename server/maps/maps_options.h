// Options of the joint maps: how often they are published, how many versions and edits are kept, and how much the
// past counts.
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
};
void Visit(OptionVisitor& visitor, MapsOptions& options);

}  // namespace cairn::server
