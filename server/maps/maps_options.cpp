#include "server/maps/maps_options.h"

namespace cairn::server {

void Visit(OptionVisitor& visitor, MapsOptions& options) {
  visitor.Real("publish_rate_hz", options.publish_rate_hz, "Hz", 0.05, 20.0,
               ForOperators("How often the changed tiles of a site are published. A higher rate gives fresher maps and "
                            "takes more computing time and network traffic."));
  visitor.Integer("max_sites", options.max_sites, "", 1, 4096,
                  ForOperators("Sites that may exist at one time. Further ones are refused."));
  visitor.Integer("max_versions", options.max_versions, "", 2, 64,
                  "Versions of the map that are kept for each site. When there are more, the oldest one "
                  "that is neither published nor enabled is forgotten. Each one takes memory for the "
                  "parts in which it differs from the present map.");
  visitor.Real("past_probability", options.past_probability, "", 0.51, 0.999,
               "Largest probability that older evidence gives a cell that another session has seen later: that of "
               "sessions which have ended, and of robots that have not looked there since. Nearer to 1, what was "
               "moved stays in the map for longer.");
  visitor.Integer("max_edits", options.max_edits, "", 0, 4096,
                  "Edits by people (cairn map edit) that each site may have at one time. Further ones are refused.");
  visitor.Real(
      "max_memory_mib", options.max_memory_mib, "MiB", 0.0, 1e9,
      "Memory that the map of each site may take with its versions (cairn map info shows it). Above it, what is "
      "least needed is given up: the layer of disagreement, old map versions that are not enabled, the "
      "difference between the oldest earlier sessions, and what earlier sessions saw where others have drawn "
      "as well. The map itself stays, also where it alone takes more. 0: no limit.");
  visitor.Real("max_total_memory_mib", options.max_total_memory_mib, "MiB", 0.0, 1e9,
               "The same for the maps of all sites together. The largest sites give up first. The estimators of the "
               "robots are not counted: robots.max_robots and robots.max_earlier limit them. 0: no limit.");
}

}  // namespace cairn::server
