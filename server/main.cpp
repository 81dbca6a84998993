// cairnd: options -> doors and server -> signals -> exit code. 0: stopped when asked to; 1: could not start, which may
// pass (an address that is not there yet); 2: wrong command line or configuration, which starting again does not mend.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/signal_set.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <iostream>
#include <sstream>

#include "common/options/config.h"
#include "common/version.h"
#include "server/command_line.h"
#include "server/egress/egress.h"
#include "server/ingress/ingress.h"
#include "server/ingress/other_servers.h"
#include "server/ops/domain_lock.h"
#include "server/ops/service_notifier.h"
#include "server/server.h"

namespace cairn::server {
namespace {

std::string PrintConfig(CairndOptions options) {
  return PrintYaml([&options](OptionVisitor& visitor) { Visit(visitor, options); });
}

void LogConfig(const CairndOptions& options) {
  std::istringstream lines(PrintConfig(options));
  for (std::string line; std::getline(lines, line);) {
    const auto content = line.find_first_not_of(' ');
    if (content != std::string::npos && line[content] != '#') spdlog::info("config: {}", line);
  }
}

// Servers of other machines are found only once both run.
void WarnOfOthers(asio::steady_timer& timer, OtherServers& others) {
  timer.expires_after(std::chrono::seconds(1));
  timer.async_wait([&timer, &others](const asio::error_code& error) {
    if (error) return;
    if (others.Joined())
      spdlog::error("another server serves this DDS domain: robots and people get half the truth from each; stop one");
    WarnOfOthers(timer, others);
  });
}

// Runs until SIGTERM or SIGINT; feeds the watchdog while the server is healthy.
void WaitForSignal(asio::io_context& context, asio::signal_set& signals, const Server& server, OtherServers& others,
                   const ServiceNotifier& notifier) {
  signals.async_wait([&context](const asio::error_code& error, int signal) {
    if (!error) spdlog::info("signal {}: stopping", signal);
    context.stop();
  });
  asio::steady_timer timer(context);
  const auto watchdog = notifier.watchdog();
  const auto period = watchdog ? *watchdog / 3 : std::chrono::microseconds(0);
  const std::function<void(const asio::error_code&)> feed = [&](const asio::error_code& error) {
    if (error) return;
    if (server.healthy()) notifier.Alive();
    timer.expires_after(period);
    timer.async_wait(feed);
  };
  if (watchdog) feed({});
  asio::steady_timer second(context);
  WarnOfOthers(second, others);
  context.run();
}

int Serve(const CairndOptions& options) {
  StartLogging(options.server.server.log_level);
  // Before any thread starts: signals reach the signal set only.
  asio::io_context context(1);
  asio::signal_set signals(context, SIGTERM, SIGINT);
  spdlog::info("cairnd {} starts in DDS domain {}", kVersion, options.wire.domain);
  LogConfig(options);

  const auto failed = [](const Status& status) {
    spdlog::critical("cannot start: {}", status.message);
    return 1;
  };
  const ProcessOptions& process = options.server.server;
  Inbound inbound(static_cast<std::size_t>(process.inbound_capacity));
  Outbound outbound(static_cast<std::size_t>(process.outbound_capacity));
  const auto lock = DomainLock::Take(options.wire.domain, options.wire.interfaces);
  if (!lock) return failed(lock.error());
  auto bus = wire::Bus::Create(options.wire, "cairnd");
  if (!bus) return failed(bus.error());
  const auto others = OtherServers::Watch(**bus);
  if (!others) return failed(others.error());
  auto egress = Egress::Open(**bus, outbound);
  if (!egress) return failed(egress.error());
  Server server(options.server, inbound, outbound);
  if (auto started = server.Start(); !started) return failed(started.error());
  auto ingress = Ingress::Open(**bus, inbound, outbound);
  if (!ingress) return failed(ingress.error());

  const ServiceNotifier notifier;
  notifier.Ready("serving DDS domain " + std::to_string(options.wire.domain));
  spdlog::info("ready");
  WaitForSignal(context, signals, server, **others, notifier);
  notifier.Stopping();

  (*ingress)->Close();
  server.Stop();
  (*egress)->Finish();
  spdlog::info("stopped; {} values left out at the door, {} malformed, {} not sent", (*ingress)->overflow(),
               (*ingress)->malformed(), outbound.refused() + (*egress)->unpublished());
  return 0;
}

int Main(int argc, char** argv) {
  int exit_code = 0;
  const auto line = ParseCommandLine(argc, argv, exit_code);
  if (!line) return exit_code;
  switch (line->task) {
    case Task::kPrintConfig:
      std::cout << PrintConfig(line->options);
      return 0;
    case Task::kCheckConfig:
      // It may be meant for another machine, or for this one with its network up.
      if (const auto present = wire::RequireInterfaces(line->options.wire); !present)
        std::cerr << "cairnd: warning: " << present.error().message << "; without it cairnd does not start\n";
      std::cout << "the configuration is valid\n";
      return 0;
    case Task::kServe:
      break;
  }
  return Serve(line->options);
}

}  // namespace
}  // namespace cairn::server

int main(int argc, char** argv) {
  return cairn::server::Main(argc, argv);
}
