// Everything cairnd can be told: the server's options and the wire's, as one tree.
#pragma once

#include "common/options/option_visitor.h"
#include "common/wire/bus.h"
#include "server/options.h"

namespace cairn::server {

struct CairndOptions {
  ServerOptions server;
  wire::WireOptions wire;
};
void Visit(OptionVisitor& visitor, CairndOptions& options);

}  // namespace cairn::server
