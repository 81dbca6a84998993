#include "server/options.h"

#include <sstream>

namespace cairn::server {
namespace {

void VisitProcess(OptionVisitor& visitor, ProcessOptions& options) {
  VisitEnum(visitor, "log_level", options.log_level, kLogLevels,
            ForOperators("Messages of this severity and of every more severe one are logged."));
  VisitEnum(visitor, "log_format", options.log_format, kLogFormats,
            "How lines of the log are written: as text for people, or each as a JSON object for programs that collect "
            "logs.");
  visitor.Integer("threads", options.threads, "", 0, 256,
                  ForOperators("Threads that run the estimators of all robots together. 0 takes one per core."));
  visitor.Text("sites", options.sites,
               ForOperators("Names of the sites that exist from the start, separated by commas."));
  visitor.Flag("create_sites", options.create_sites,
               ForOperators("Whether a robot that names an unknown site makes it. If not, such a robot is refused."));
  visitor.Integer(
      "inbound_capacity", options.inbound_capacity, "values", 64, 1048576,
      "Messages of streams that may wait between the DDS readers and the server, and as many requests. What "
      "comes when the queue is full is dropped and counted.");
  visitor.Integer("outbound_capacity", options.outbound_capacity, "values", 64, 1048576,
                  "Messages that may wait between the server and the DDS writers, for each of the three lanes (live, "
                  "map and replies).");
  visitor.Integer("query_queue", options.query_queue, "requests", 1, 65536,
                  "Requests of clients that may wait. Further ones are answered RESOURCE_EXHAUSTED at once.");
  visitor.Real("stop_timeout_s", options.stop_timeout_s, "s", 0.0, 8.0,
               ForOperators("Time to finish the accepted scans after SIGTERM. Scans left after it are dropped and "
                            "counted. systemd kills the process after 10 s."));
  visitor.Real(
      "stall_limit_s", options.stall_limit_s, "s", 0.5, 600.0,
      "A thread that has work and finishes nothing for longer than this stops the watchdog messages to systemd, "
      "which then restarts the server. Smaller values notice a hang sooner, and may mistake a busy machine for "
      "one.");
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
  visitor.Section("robots", "Robots and their queues.", [&] { Visit(visitor, options.robots); });
  visitor.Section("maps", "The joint map of each site.", [&] { Visit(visitor, options.maps); });
  visitor.Section("jobs", "Work in the background, such as smoothing.", [&] { Visit(visitor, options.jobs); });
  visitor.Section("store",
                  "The state that outlives the server. Its directory is given by the option --state of cairnd.",
                  [&] { Visit(visitor, options.store); });
  const ProcessOptions& process = options.server;
  const auto sites = static_cast<std::int64_t>(process.site_names().size());
  visitor.Require(process.create_sites || sites > 0, "server.create_sites", "leaves no site without a name in",
                  "server.sites");
  visitor.Require(sites <= options.maps.max_sites, "server.sites", "must not have more names than", "maps.max_sites");
  // Each channel has room for at least one message of every robot.
  visitor.Require(process.inbound_capacity >= options.robots.max_robots, "server.inbound_capacity", "must be at least",
                  "robots.max_robots");
  visitor.Require(process.outbound_capacity >= options.robots.max_robots, "server.outbound_capacity",
                  "must be at least", "robots.max_robots");
}

}  // namespace cairn::server
