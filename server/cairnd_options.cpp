#include "server/cairnd_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, CairndOptions& options) {
  Visit(visitor, options.server);
  visitor.Section("wire", "The DDS domain.", [&] { wire::Visit(visitor, options.wire); });
}

}  // namespace cairn::server
