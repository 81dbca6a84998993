// The whole server on a store in a directory, as cairnd has it: the next one on the same directory goes on.
#pragma once

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

}  // namespace cairn::server::testing
