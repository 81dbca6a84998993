// Settings of the wire that do not come from the configuration file, and their order of precedence. All
// programs use the same order.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/options/config.h"
#include "common/status.h"

namespace cairn::wire {

struct WireArguments {
  std::vector<std::string> assignments;  // --set KEY=VALUE, with keys of all sections that the program has.
  std::optional<std::int64_t> domain;    // --domain
};

// Applies the settings in this order, so that the last one wins: the environment variable CAIRN_DOMAIN
// (ignored if empty), --set, --domain. The options must have a key `wire.domain`, and a configuration file
// must be applied before. An error names its source; the settings before it stay applied.
[[nodiscard]] Result<void> Apply(const WireArguments& arguments, const VisitOptions& visit);

}  // namespace cairn::wire
