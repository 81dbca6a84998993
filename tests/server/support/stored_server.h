// The whole server on a store in a directory, as cairnd has it (without DDS): the next one on the same directory goes
// on. And what a kill leaves of it.
#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>

#include "server/store/sqlite_store.h"
#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {

inline constexpr ClientId kDriver = 7;
// A server with a store in a directory.
class StoredServer {
 public:
  // `vfs`: of SQLite, for disks that fail (tests/server/store/faulty_vfs.h).
  explicit StoredServer(const std::filesystem::path& directory, ServerOptions options = TestOptions(),
                        const std::string& vfs = {}, const StoreOptions& store = {.commit_delay_ms = 5})
      : store_(*OpenStore(directory, vfs)),
        journal_(*store_, store),
        generation_(*NextGeneration(*store_, 1)),
        house_(options, &journal_, generation_, directory / "saved") {
    journal_.Start();
  }
  ~StoredServer() {
    house_.Stop();
    journal_.Stop();
  }
  WholeServer* operator->() { return &house_; }
  WholeServer& house() { return house_; }
  Store& store() { return *store_; }

 private:
  const std::unique_ptr<Store> store_;
  Journal journal_;
  const Generation generation_;
  WholeServer house_;
};

// What a kill at this moment leaves.
inline void CopyState(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::filesystem::create_directory(to);
  for (const char* name : {"cairn.db", "cairn.db-wal"}) std::filesystem::copy_file(from / name, to / name);
}

// The robot's client says that it had its session before: it meets a server that was started since.
inline void SayStarted(WholeServer& house, const std::string& robot = "r1", ClientId client = kDriver) {
  house.Push(SessionRequest{.robot = robot,
                            .site = "lab",
                            .sensors = {"laser"},
                            .client = client,
                            .has_start = true,
                            .T_map_robot_start = {},
                            .end = false,
                            .session = client,
                            .started = true});
}

inline Request About(RequestKind kind, const std::string& robot = "r1") {
  Request request;
  request.kind = kind;
  request.site = "lab";
  request.robot = robot;
  return request;
}

inline Trajectory PathOf(WholeServer& house, const std::string& robot = "r1") {
  return house.Ask(About(RequestKind::kPath, robot)).path;
}

inline bool SamePath(const Trajectory& a, const Trajectory& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](const auto& x, const auto& y) {
           return x.stamp == y.stamp && x.T_map_robot == y.T_map_robot;
         });
}

inline std::uint64_t DurableScans(WholeServer& house, const std::string& robot = "r1") {
  const Reply status = house.Ask(About(RequestKind::kStatus, robot));
  return status.robots.empty() || status.robots[0].ledgers.empty() ? 0 : status.robots[0].ledgers[0].durable_through;
}

// A server with two robots, which then stops.
inline void DriveTwoRobots(const std::filesystem::path& state, const ServerOptions& options) {
  StoredServer server(state, options);
  for (const char* robot : {"r1", "r2"}) {
    server->Open(robot, kDriver);
    server->Drive(robot, kDriver, 0, 60);
  }
  ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r2").durable_through == 60; }));
}

}  // namespace cairn::server::testing
