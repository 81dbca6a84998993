// How the joint maps are published and how many versions are kept.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct MapsOptions {
  double publish_rate_hz = 2.0;   // Changed tiles per site; higher: fresher tiles, more encoding and traffic.
  std::int64_t max_sites = 64;    // More are refused.
  std::int64_t max_versions = 8;  // Kept per site to roll back to; each costs the chunks that differ from the live map.
};
void Visit(OptionVisitor& visitor, MapsOptions& options);

}  // namespace cairn::server
