#include "tests/studies/soak/soaked_server.h"

#include <chrono>
#include <stdexcept>
#include <string>

#include "server/store/checkpoint_writer.h"
#include "server/store/sqlite_store.h"
#include "tests/must.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/stopwatch.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

constexpr std::chrono::seconds kReady{600};
constexpr double kMib = 1024.0 * 1024.0;

// Of the server on the copy: TestDomain is at most 200, and a domain above 232 has no ports.
std::int64_t OtherDomain() {
  return 201 + test::TestDomain() % 30;
}

std::unique_ptr<ChildProcess> StartServer(std::int64_t domain, const std::filesystem::path& state) {
  auto server = std::make_unique<ChildProcess>(
      std::vector<std::string>{ProgramPath("cairnd"), "--domain", std::to_string(domain), "--state", state.string()});
  if (!server->Says(" ready", kReady)) throw std::runtime_error("cairnd does not start: " + server->Wait().output);
  return server;
}

}  // namespace

SoakedServer::SoakedServer() : server_(StartServer(test::TestDomain(), directory_ / "state")) {}

double SoakedServer::resident_mib() const {
  return ResidentMibOf(server_->pid());
}

double SoakedServer::disk_mib() const {
  double bytes = 0.0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(directory_ / "state")) {
    if (file.is_regular_file()) bytes += static_cast<double>(file.file_size());
  }
  return bytes / kMib;
}

double SoakedServer::cpu_s() const {
  return CpuSecondsOf(server_->pid());
}

SoakedServer::Restart SoakedServer::RestartOnCopy() const {
  const TempDirectory copy;
  server_->Signal(SIGSTOP);  // So that all files are of one moment.
  std::filesystem::copy(directory_ / "state", copy / "state", std::filesystem::copy_options::recursive);
  server_->Signal(SIGCONT);
  Restart restart;
  const auto start = std::chrono::steady_clock::now();
  auto restarted = StartServer(OtherDomain(), copy / "state");
  restart.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  restarted.reset();
  const auto store = test::Must(server::OpenStore(copy / "state"));
  const auto sessions = test::Must(store->Owners(server::RecordKind::kCheckpoint));
  if (sessions.empty()) return restart;
  const auto checkpoint = test::Must(server::ReadCheckpoint(*store, sessions.front()));
  if (!checkpoint) return restart;
  restart.checkpoint_mib = static_cast<double>(checkpoint->bytes.size()) / kMib;
  for (const auto& [number, piece] : checkpoint->pieces) restart.pieces_mib += static_cast<double>(piece.size()) / kMib;
  return restart;
}

}  // namespace cairn::studies
