// The whole server on a store in a directory, as cairnd has it: the next one on the same directory goes on.
#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>

#include "server/store/sqlite_store.h"
#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {

// A server with a store in a directory.
class StoredServer {
 public:
  explicit StoredServer(const std::filesystem::path& directory, ServerOptions options = TestOptions())
      : store_(*OpenStore(directory)),
        journal_(*store_, {.commit_delay_ms = 5}),
        generation_(*NextGeneration(*store_, 1)),
        house_(options, &journal_, generation_, directory / "saved") {
    journal_.Start();
  }
  ~StoredServer() {
    house_.Stop();
    journal_.Stop();
  }
  WholeServer* operator->() { return &house_; }
  Store& store() { return *store_; }

 private:
  const std::unique_ptr<Store> store_;
  Journal journal_;
  const Generation generation_;
  WholeServer house_;
};

inline bool SamePath(const Trajectory& a, const Trajectory& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](const auto& x, const auto& y) {
           return x.stamp == y.stamp && x.T_map_robot == y.T_map_robot;
         });
}

}  // namespace cairn::server::testing
