#include "server/options.h"

#include <sstream>

namespace cairn::server {
namespace {

void VisitProcess(OptionVisitor& visitor, ProcessOptions& options) {
  VisitEnum(visitor, "log_level", options.log_level, kLogLevels, "What is logged: this and everything more severe.");
  visitor.Integer("threads", options.threads, "", 0, 256, "For the robots' estimators; 0: one per core.");
  visitor.Text("sites", options.sites, "Comma-separated names of sites made at start.");
  visitor.Flag("create_sites", options.create_sites, "A robot may name a site that does not exist yet.");
  visitor.Integer("inbound_capacity", options.inbound_capacity, "values", 64, 1048576,
                  "Between the DDS doors and the rooms, inwards; what does not fit is left out and counted.");
  visitor.Integer("outbound_capacity", options.outbound_capacity, "values", 64, 1048576,
                  "Between the rooms and the DDS doors, outwards, per lane (live, map, replies).");
  visitor.Integer("query_queue", options.query_queue, "requests", 1, 65536,
                  "Requests waiting; more are answered RESOURCE_EXHAUSTED at once.");
  visitor.Real("stop_timeout_s", options.stop_timeout_s, "s", 0.0, 8.0,
               "For finishing accepted scans after SIGTERM; what is left then is dropped and counted (systemd kills "
               "after 10 s).");
  visitor.Real("stall_limit_s", options.stall_limit_s, "s", 0.5, 600.0,
               "A strand silent for longer stops the pings to the service manager's watchdog.");
}

}  // namespace

std::vector<std::string> ProcessOptions::site_names() const {
  std::vector<std::string> names;
  std::istringstream text(sites);
  for (std::string name; std::getline(text, name, ',');) {
    const auto first = name.find_first_not_of(" \t");
    if (first == std::string::npos) continue;
    names.push_back(name.substr(first, name.find_last_not_of(" \t") - first + 1));
  }
  return names;
}

void Visit(OptionVisitor& visitor, ServerOptions& options) {
  visitor.Section("server", "The server as a process.", [&] { VisitProcess(visitor, options.server); });
  visitor.Section("slam", "The estimator of each robot.", [&] { slam::Visit(visitor, options.slam); });
  visitor.Section("robots", "Sessions and their queues.", [&] { Visit(visitor, options.robots); });
  visitor.Section("maps", "The joint map of each site.", [&] { Visit(visitor, options.maps); });
  visitor.Section("jobs", "Work on the side.", [&] { Visit(visitor, options.jobs); });
}

}  // namespace cairn::server
