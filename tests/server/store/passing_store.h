// A store that passes every call on to another one. Tests override what is to be different.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "server/store/store.h"

namespace cairn::server::testing {

class PassingStore : public Store {
 public:
  // `store` outlives this one.
  explicit PassingStore(Store& store) : store_(store) {}
  Result<void> Commit(const RecordChanges& changes) override { return store_.Commit(changes); }
  Result<void> CommitEach(const Next& next) override { return store_.CommitEach(next); }
  Result<std::size_t> RemoveFirst(const RecordRange& range, std::size_t count) override {
    return store_.RemoveFirst(range, count);
  }
  Result<void> Read(const RecordRange& range, const Visit& visit) override { return store_.Read(range, visit); }
  Result<std::vector<std::uint64_t>> Owners(RecordKind kind) override { return store_.Owners(kind); }
  Result<std::vector<std::uint64_t>> Numbers(const RecordRange& range) override { return store_.Numbers(range); }
  [[nodiscard]] std::size_t max_record_bytes() const override { return store_.max_record_bytes(); }
  [[nodiscard]] std::filesystem::path directory() const override { return store_.directory(); }
  Result<std::uint64_t> bytes_used() override { return store_.bytes_used(); }

 protected:
  [[nodiscard]] Store& store() { return store_; }

 private:
  Store& store_;
};

}  // namespace cairn::server::testing
