// What is said of the wire beside the configuration file, and in which order: one rule for every program with a bus.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/options/config.h"
#include "common/status.h"

namespace cairn::wire {

struct WireArguments {
  std::vector<std::string> assignments;  // --set KEY=VALUE, of any section the program has.
  std::optional<std::int64_t> domain;    // --domain
};

// Least first: CAIRN_DOMAIN of the environment (empty says nothing), --set, --domain. The tree must have `wire.domain`;
// a file is to be applied before. An error names its source; what came before it stays applied.
[[nodiscard]] Result<void> Apply(const WireArguments& arguments, const VisitOptions& visit);

}  // namespace cairn::wire
