// Options of the store. Its directory is an argument of the command line (--state), because it depends on the machine.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"

namespace cairn::server {

struct StoreOptions {
  std::int64_t commit_delay_ms = 100;
  std::int64_t queue_mib = 64;
  double max_gib = 20.0;
  double max_saved_gib = 20.0;
};
void Visit(OptionVisitor& visitor, StoreOptions& options);

[[nodiscard]] constexpr std::uint64_t BytesOf(double gib) {
  return static_cast<std::uint64_t>(gib * 1024.0 * 1024.0 * 1024.0);
}

}  // namespace cairn::server
