#include <fmt/format.h>

#include <chrono>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/percentiles.h"

namespace cairn::client {
namespace {

ExitCode Ping(Program& program, int count) {
  Percentiles round_trips_ms;
  std::string version;
  for (int i = 0; i < count && !Interrupted(); ++i) {
    const auto start = std::chrono::steady_clock::now();
    const auto reply = program.Ask([](QueryClient& server) { return server.Ping(); });
    if (!reply) return program.Refuse(reply.error());
    // The first answer includes the time to find the server.
    if (i > 0 || count == 1) {
      round_trips_ms.Add(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    }
    version = *reply;
  }
  return program.Print(fmt::format("server {} on domain {}: round trip p50 {:.2f} ms, p99 {:.2f} ms\n", version,
                                   program.options.wire.domain, round_trips_ms.At(0.5), round_trips_ms.At(0.99)),
                       {{"server_version", version},
                        {"domain", program.options.wire.domain},
                        {"round_trip_p50_ms", round_trips_ms.At(0.5)},
                        {"round_trip_p99_ms", round_trips_ms.At(0.99)}});
}

}  // namespace

void AddPing(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("ping", "Ask the server whether it is there, and how fast it answers");
  auto count = std::make_shared<int>(1);
  command->add_option("-c,--count", *count, "How many times to ask")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  program.OnChosen(*command, count, Ping);
}

}  // namespace cairn::client
