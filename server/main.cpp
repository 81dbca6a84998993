// The main function of cairnd. It reads the options, starts the server and its connections to DDS, waits for
// a signal, and stops. Exit codes: 0 stopped on request; 1 could not start, but a
// later try may succeed (for example, an address does not exist yet); 2 wrong command line or configuration, so that a
// restart would fail again, also because of a store that a newer server has written or that is damaged; 3 stopped on
// request, but the store had failed and the last data is lost; 4 ended itself, because it had not worked for a minute
// and no service manager watched it: start it again.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/signal_set.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "common/options/config.h"
#include "common/version.h"
#include "common/wall_clock.h"
#include "server/command_line.h"
#include "server/door_losses.h"
#include "server/egress/egress.h"
#include "server/ingress/ingress.h"
#include "server/ingress/other_servers.h"
#include "server/ops/domain_lock.h"
#include "server/ops/end_when_stuck.h"
#include "server/ops/heartbeat.h"
#include "server/ops/process_load.h"
#include "server/ops/service_notifier.h"
#include "server/ros2/ros2_door.h"
#include "server/server.h"
#include "server/state_directory.h"
#include "server/store/sqlite_store.h"

namespace cairn::server {
namespace {

std::string PrintConfig(CairndOptions options) {
  return PrintYaml([&options](OptionVisitor& visitor) { Visit(visitor, options); });
}

// What is set otherwise than by default; `cairnd --print-config` with the same arguments prints all of it.
void LogConfig(const CairndOptions& options) {
  const auto lines_of = [](const CairndOptions& of) {
    std::vector<std::string> lines;
    std::istringstream text(PrintConfig(of));
    for (std::string line; std::getline(text, line);) {
      const auto content = line.find_first_not_of(' ');
      if (content != std::string::npos && line[content] != '#') lines.push_back(line.substr(0, line.find("  #")));
    }
    return lines;
  };
  const std::vector<std::string> set = lines_of(options), usual = lines_of({});
  std::vector<std::string> sections;  // Those that the line is in, by their depth.
  for (std::size_t i = 0; i < set.size(); ++i) {
    const auto depth = set[i].find_first_not_of(' ') / 2;
    sections.resize(std::min(sections.size(), depth));
    const std::string entry = set[i].substr(2 * depth);
    if (entry.ends_with(':')) sections.push_back(entry.substr(0, entry.size() - 1) + ".");
    if (i >= usual.size() || set[i] == usual[i]) continue;
    spdlog::info("config: {}{}", fmt::join(sections, ""), entry);
  }
}

// What the main thread checks while the server runs.
struct Watched {
  wire::Bus& bus;
  Server& server;
  const Inbound& inbound;
  const Outbound& outbound;
  const Ingress& ingress;
  const Egress& egress;
  OtherServers& others;
  const Journal* journal;  // Null if nothing is stored.
  const Ros2Door* ros2;    // Null if ROS 2 robots are not served.
  std::chrono::steady_clock::time_point started;
};

DoorCounts LossesOf(const Watched& watched) {
  DoorCounts counts{.inbound_full = watched.ingress.overflow(),
                    .malformed = watched.ingress.malformed(),
                    .uncounted_scans = watched.server.uncounted_scans(),
                    .outbound_full = watched.outbound.refused(),
                    .unpublished = watched.egress.unpublished()};
  if (watched.ros2 != nullptr) {
    counts.inbound_full += watched.ros2->overflow();
    counts.malformed += watched.ros2->malformed();
    counts.unpublished += watched.ros2->unpublished();
  }
  return counts;
}

void TellLoad(const Watched& watched) {
  const std::chrono::duration<double> up = std::chrono::steady_clock::now() - watched.started;
  const DelayMeter::Quantiles waits = watched.server.robot_waits();
  ServerLoad load{.up_s = up.count(),
                  .processor_s = ProcessorSeconds(),
                  .memory_bytes = ResidentBytes(),
                  .inbound_waiting = watched.inbound.size(),
                  .outbound_waiting = watched.outbound.size(),
                  .strand_wait_p50_ms = waits.p50_ms,
                  .strand_wait_p99_ms = waits.p99_ms};
  if (watched.journal != nullptr) {
    const JournalCounts counts = watched.journal->counts();
    load.stores = true;
    load.commits = counts.commits;
    load.failed_commits = counts.failed_commits;
    load.store_bytes = counts.store_bytes;
    load.stored_after_p50_ms = counts.delay_p50_ms;
    load.stored_after_p99_ms = counts.delay_p99_ms;
  }
  watched.server.SetLoad(load);
}

void TellRefusals(const Watched& watched) {
  // Asking for the counts also finds peers that have answered too late; their lines come with them.
  Refusals refusals = watched.bus.refusals();
  for (const std::string& line : watched.bus.TakeRefusalLines()) spdlog::warn("security: {}", line);
  refusals.commands = watched.ingress.commands_refused();
  refusals.over_limit = watched.outbound.over_limit();
  if (watched.ros2 != nullptr) refusals.datagrams += watched.ros2->datagrams_refused();
  watched.server.SetRefusals(refusals);
}

constexpr std::chrono::minutes kLongestUnhealthy{1};

// Checks for servers on other machines (they are discovered only when both run), for refused peers, for lost messages,
// whether the store works and how busy the server is.
void LookOnce(const Watched& watched, DoorLosses& losses, ServiceStatus& status) {
  if (watched.others.Joined()) {
    spdlog::error("another server serves this DDS domain: clients get answers from both; stop one of them");
  }
  TellRefusals(watched);
  TellLoad(watched);
  auto busy = watched.bus.busy_with_one_datagram();
  if (watched.ros2 != nullptr) busy = std::max(busy, watched.ros2->busy_with_one_datagram());
  watched.server.SetReceiving(busy);
  const DoorCounts counts = LossesOf(watched);
  if (const auto line = losses.Check(counts, DoorLosses::Clock::now())) {
    spdlog::warn("{}", *line);
    status.Losses(TextOf(counts));
  }
  if (watched.ros2 != nullptr) watched.server.SetRos2(watched.ros2->report());
  if (watched.journal != nullptr) status.Degraded(watched.journal->health().reason);
}

// The same once a second.
void Look(asio::steady_timer& timer, const Watched& watched, DoorLosses& losses, ServiceStatus& status) {
  timer.expires_after(std::chrono::seconds(1));
  timer.async_wait([&](const asio::error_code& error) {
    if (error) return;
    try {
      LookOnce(watched, losses, status);
    } catch (const std::exception& failure) {  // Such as memory that is short for a moment.
      spdlog::error("a look at the doors failed with an exception: {}", failure.what());
    }
    Look(timer, watched, losses, status);
  });
}

// Runs until SIGTERM or SIGINT. Notifies the watchdog while the server is healthy; where there is none, ends the
// process when it has not been healthy for kLongestUnhealthy.
void WaitForSignal(asio::io_context& context, asio::signal_set& signals, const Watched& watched,
                   const ServiceNotifier& notifier, ServiceStatus& status) {
  signals.async_wait([&context](const asio::error_code& error, int signal) {
    if (!error) spdlog::info("signal {}: stopping", signal);
    context.stop();
  });
  asio::steady_timer timer(context);
  const auto watchdog = notifier.watchdog();
  const auto period = watchdog ? *watchdog / 3 : std::chrono::microseconds(std::chrono::seconds(1));
  EndWhenStuck end_when_stuck(kLongestUnhealthy);
  const std::function<void(const asio::error_code&)> check = [&](const asio::error_code& error) {
    if (error) return;
    const bool healthy = watched.server.healthy();
    if (healthy) notifier.Alive();
    if (!watchdog) end_when_stuck.Look(healthy, Heartbeat::Clock::now());
    timer.expires_after(period);
    timer.async_wait(check);
  };
  check({});
  asio::steady_timer second(context);
  DoorLosses losses;
  Look(second, watched, losses, status);
  context.run();
}

constexpr int kDegraded = 3;

std::uint64_t MillisecondsSince1970() {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(1, WallClock() / kNanosPerMillisecond));
}

// A later start may succeed if another server used the store or the disk failed. A newer or damaged store stays so.
int ExitCodeOf(const Status& status) {
  return status.code == StatusCode::kFailedPrecondition || status.code == StatusCode::kDataLoss ? 2 : 1;
}

// The store and its journal, and the number of this start.
struct KeptState {
  std::unique_ptr<Store> store;
  std::unique_ptr<Journal> journal;  // Null if nothing is stored.
  Generation generation = MillisecondsSince1970();
};

Result<KeptState> OpenState(const StoreOptions& options, const std::filesystem::path& place) {
  KeptState kept;
  if (place == kNoState) return kept;
  auto store = OpenStore(place);
  if (!store) return tl::unexpected(store.error());
  kept.store = std::move(*store);
  const auto generation = NextGeneration(*kept.store, kept.generation);
  if (!generation) return tl::unexpected(generation.error());
  kept.generation = *generation;
  kept.journal = std::make_unique<Journal>(*kept.store, options);
  spdlog::info("generation {}, state in {}", kept.generation, place.string());
  return kept;
}

// Writes what still waits. Returns the exit code of a server that stops on request.
int StopJournal(Journal& journal) {
  journal.Stop();
  const JournalCounts counts = journal.counts();
  spdlog::info("store: {} entries in {} commits, {} failed; on the disk after {:.1f} ms (median), {:.1f} ms (p99)",
               counts.entries, counts.commits, counts.failed_commits, counts.delay_p50_ms, counts.delay_p99_ms);
  const JournalHealth health = journal.health();
  if (health.degraded) {
    spdlog::critical("stopped while degraded: {}", health.reason);
    return kDegraded;
  }
  if (const std::string aside = journal.set_aside().text(); !aside.empty()) {
    spdlog::error("stopped; all new data is stored, but some of the old could not be read: {}", aside);
    return kDegraded;
  }
  return 0;
}

// The door for ROS 2 robots; null if it is not wanted.
Result<std::unique_ptr<Ros2Door>> OpenRos2(const CairndOptions& options, bool keeps_sites, Inbound& inbound,
                                           Outbound& outbound) {
  if (!options.ros2.enabled) return nullptr;
  auto door =
      Ros2Door::Open(options.ros2, options.wire, {keeps_sites, options.server.server.create_sites}, inbound, outbound);
  if (door) spdlog::info("ROS 2 robots are served in DDS domain {}", options.ros2.domain);
  return door;
}

constexpr std::chrono::seconds kStartPeriod{2};
constexpr std::chrono::seconds kStartMayTakeLonger{60};

// Tells the service manager that the start goes on, as long as it does, so that it is not taken for one that hangs.
void LookAtStart(asio::steady_timer& timer, const StartControl& control, std::uint64_t advanced,
                 const ServiceNotifier& notifier) {
  timer.expires_after(kStartPeriod);
  timer.async_wait([&timer, &control, advanced, &notifier](const asio::error_code& error) {
    if (error) return;
    const std::uint64_t now = control.advanced();
    if (now != advanced)
      notifier.Starting("restoring: " + std::to_string(now) + " entries of the journals processed",
                        kStartMayTakeLonger);
    LookAtStart(timer, control, now, notifier);
  });
}

// Starts the server. A signal gives that up: CANCELLED.
Result<void> StartWatched(Server& server, asio::io_context& context, asio::signal_set& signals,
                          const ServiceNotifier& notifier) {
  StartControl control;
  signals.async_wait([&control](const asio::error_code& error, int signal) {
    if (error) return;
    spdlog::info("signal {}: the start is given up", signal);
    control.GiveUp();
  });
  asio::steady_timer timer(context);
  LookAtStart(timer, control, 0, notifier);
  Result<void> started;
  {
    struct StopsAtTheEnd {
      asio::io_context& context;
      ~StopsAtTheEnd() { context.stop(); }
    };
    const std::jthread watching([&context] { context.run(); });
    const StopsAtTheEnd stops{context};  // Also if an exception ends the start: the thread would not end otherwise.
    started = server.Start(control);
  }
  timer.cancel();
  signals.cancel();
  // A signal may have come last.
  context.restart();
  context.poll();
  context.restart();
  if (started && control.given_up()) return Fail(StatusCode::kCancelled, "the start was given up");
  return started;
}

int Serve(const CairndOptions& options, const std::filesystem::path& state) {
  const auto started = std::chrono::steady_clock::now();
  StartLogging(options.server.server.log_level, options.server.server.log_format);
  // The signal set is made before any thread starts, so that no thread receives the signals instead.
  asio::io_context context(1);
  asio::signal_set signals(context, SIGTERM, SIGINT);
  spdlog::info("cairnd {} starts in DDS domain {}", kVersion, options.wire.domain);
  LogConfig(options);

  const ServiceNotifier notifier;
  const auto failed = [&notifier](const Status& status) {
    spdlog::critical("cannot start: {}", status.message);
    // systemd starts it again at once, as is right after a crash. What keeps it from starting may last for long.
    if (notifier.Failed(status.message)) std::this_thread::sleep_for(std::chrono::seconds(2));
    return ExitCodeOf(status);
  };
  const ProcessOptions& process = options.server.server;
  Inbound inbound(static_cast<std::size_t>(process.inbound_capacity));
  Outbound outbound(static_cast<std::size_t>(process.outbound_capacity));
  const auto lock = DomainLock::Take(options.wire.domain, options.wire.interfaces);
  if (!lock) return failed(lock.error());
  auto kept = OpenState(options.server.store, state);
  if (!kept) return failed(kept.error());
  auto bus = wire::Bus::Create(options.wire, "cairnd");
  if (!bus) return failed(bus.error());
  const auto others = OtherServers::Watch(**bus);
  if (!others) return failed(others.error());
  auto egress = Egress::Open(**bus, outbound, kept->generation);
  if (!egress) return failed(egress.error());
  const auto saved = state == kNoState || state == kInMemory ? std::filesystem::path() : state / "saved";
  auto ros2 = OpenRos2(options, !saved.empty(), inbound, outbound);
  if (!ros2) return failed(ros2.error());
  Server server(options.server, inbound, outbound, kept->generation, kept->journal.get(), saved);
  if (auto serves = StartWatched(server, context, signals, notifier); !serves) {
    if (serves.error().code != StatusCode::kCancelled) return failed(serves.error());
    spdlog::info("stopped before the start was finished");
    return 0;
  }
  if (kept->journal != nullptr) kept->journal->Start();
  auto ingress = Ingress::Open(**bus, inbound, outbound);
  if (!ingress) return failed(ingress.error());
  if (*ros2 != nullptr) {
    (*ros2)->Start();
    server.SetRos2((*ros2)->report());
  }

  const std::string serving = "serving DDS domain " + std::to_string(options.wire.domain);
  ServiceStatus service_status(notifier, serving);
  notifier.Ready(serving);
  spdlog::info("ready");
  const Watched watched{**bus,       server, inbound, outbound, **ingress, **egress, **others, kept->journal.get(),
                        ros2->get(), started};
  TellLoad(watched);
  WaitForSignal(context, signals, watched, notifier, service_status);
  notifier.Stopping();

  (*ingress)->Close();
  if (*ros2 != nullptr) (*ros2)->Close();
  server.Stop();
  (*egress)->Finish();
  if (*ros2 != nullptr) (*ros2)->Finish();
  const int exit_code = kept->journal == nullptr ? 0 : StopJournal(*kept->journal);
  spdlog::info("datagrams refused by reason: {}", (*bus)->refused_by_reason());
  spdlog::info("stopped; messages lost between DDS and the server since the start: {}", TextOf(LossesOf(watched)));
  return exit_code;
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
      // Only a warning: the file may be for another machine, or this machine's network may not be up yet.
      if (const auto present = wire::RequireInterfaces(line->options.wire); !present)
        std::cerr << "cairnd: warning: " << present.error().message << "; cairnd does not start without it\n";
      std::cout << "the configuration is valid\n";
      return 0;
    case Task::kServe:
      break;
  }
  return Serve(line->options, line->state);
}

}  // namespace
}  // namespace cairn::server

int main(int argc, char** argv) {
  return cairn::server::Main(argc, argv);
}
