#include "server/cairnd_options.h"

#include "common/options/config.h"
#include "common/service/names.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, CairndOptions& options) {
  Visit(visitor, options.server);
  visitor.Section("wire", "The DDS network.", [&] { wire::Visit(visitor, options.wire); });
}

Result<void> Validate(const CairndOptions& options) {
  if (auto valid = wire::Validate(options.wire); !valid) return valid;
  for (const std::string& site : options.server.server.site_names())
    if (auto valid = ValidateName("server.sites", site); !valid) return valid;
  CairndOptions copy = options;
  return CheckRules([&copy](OptionVisitor& visitor) { Visit(visitor, copy); });
}

}  // namespace cairn::server
