#include "server/maps/maps_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, MapsOptions& options) {
  visitor.Real("publish_rate_hz", options.publish_rate_hz, "Hz", 0.05, 20.0,
               "How often a site's changed tiles are rendered and published.");
  visitor.Integer("max_sites", options.max_sites, "", 1, 4096, "Sites served at one time; more are refused.");
  visitor.Integer("max_versions", options.max_versions, "", 2, 64,
                  "Map versions kept per site; when full the oldest that is neither live nor enabled is forgotten.");
}

}  // namespace cairn::server
