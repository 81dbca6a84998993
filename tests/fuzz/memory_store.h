// A store in memory whose records need no checksum: what a stranger who knows the checksum has written.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/store/store.h"

namespace cairn::fuzz {

class MemoryStore : public server::Store {
 public:
  Result<void> Commit(const server::RecordChanges& changes) override {
    for (const server::RecordRange& range : changes.removed)
      std::erase_if(records_, [&range](const auto& record) { return Within(range, record.first); });
    for (const server::Record& record : changes.put) records_[record.key] = record.bytes;
    return {};
  }
  Result<void> CommitEach(const Next& next) override {
    for (;;) {
      auto record = next();
      if (!record) return tl::unexpected(record.error());
      if (!*record) return {};
      records_[(*record)->key] = (*record)->bytes;
    }
  }
  Result<std::size_t> RemoveFirst(const server::RecordRange& range, std::size_t count) override {
    std::size_t removed = 0;
    for (auto record = records_.begin(); record != records_.end() && removed < count;) {
      if (!Within(range, record->first)) {
        ++record;
        continue;
      }
      record = records_.erase(record);
      ++removed;
    }
    return removed;
  }
  Result<void> Read(const server::RecordRange& range, const Visit& visit) override {
    for (const auto& [key, bytes] : records_) {
      if (!Within(range, key)) continue;
      if (auto visited = visit(key.number, std::string(bytes)); !visited) return visited;
    }
    return {};
  }
  Result<std::vector<std::uint64_t>> Owners(server::RecordKind kind) override {
    std::set<std::uint64_t> owners;
    for (const auto& [key, bytes] : records_)
      if (key.kind == kind) owners.insert(key.owner);
    return std::vector<std::uint64_t>(owners.begin(), owners.end());
  }
  Result<std::vector<std::uint64_t>> Numbers(const server::RecordRange& range) override {
    std::vector<std::uint64_t> numbers;
    for (const auto& [key, bytes] : records_)
      if (Within(range, key)) numbers.push_back(key.number);
    return numbers;
  }
  Result<std::uint64_t> bytes_used() override { return 0; }

  void Put(const server::RecordKey& key, std::string_view bytes) { records_[key] = bytes; }
  [[nodiscard]] const std::map<server::RecordKey, std::string>& records() const { return records_; }

 private:
  static bool Within(const server::RecordRange& range, const server::RecordKey& key) {
    return key.kind == range.kind && key.owner == range.owner && key.number >= range.first && key.number <= range.last;
  }

  std::map<server::RecordKey, std::string> records_;  // By kind, owner, number.
};

}  // namespace cairn::fuzz
