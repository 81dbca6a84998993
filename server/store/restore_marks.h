// Remembers on the disk which sessions a server is about to restore, so that a session whose restoring ends the process
// does not end every later start as well: what is still marked at a start was being restored when the process ended.
// A process that is killed from outside at that moment looks the same. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "server/store/store.h"

namespace cairn::server {

class RestoreMarks {
 public:
  // A damaged mark counts as one failure.
  [[nodiscard]] static Result<RestoreMarks> Read(Store& store);

  // The mark that so many processes ended while they restored the session.
  [[nodiscard]] static Record RecordOf(std::uint64_t session, std::uint32_t failures);

  // How many processes ended while they restored this session.
  [[nodiscard]] std::uint32_t failed(std::uint64_t session) const;
  // These return when the change is on the disk.
  [[nodiscard]] Result<void> Begin(const std::vector<std::uint64_t>& sessions);
  [[nodiscard]] Result<void> Set(std::uint64_t session, std::uint32_t failures);
  [[nodiscard]] Result<void> Succeeded(const std::vector<std::uint64_t>& sessions);

 private:
  explicit RestoreMarks(Store& store) : store_(&store) {}

  Store* store_;
  std::map<std::uint64_t, std::uint32_t> failed_;
};

}  // namespace cairn::server
