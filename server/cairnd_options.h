// All options of cairnd, those of the server and those of the wire, as one tree.
#pragma once

#include "common/options/option_visitor.h"
#include "common/status.h"
#include "common/wire/bus.h"
#include "server/options.h"

namespace cairn::server {

struct CairndOptions {
  ServerOptions server;
  wire::WireOptions wire;
};
void Visit(OptionVisitor& visitor, CairndOptions& options);
// Checks what does not depend on the machine: fields that contradict each other, names of sites, and
// addresses. It reads no file.
[[nodiscard]] Result<void> Validate(const CairndOptions& options);

}  // namespace cairn::server
