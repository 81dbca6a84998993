// What a journal says is on the disk, and what is there.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <vector>

#include "server/store/journal.h"

namespace cairn::server::testing {

// The positions of a session's entries in the store.
inline std::uint64_t StoredEntries(Store& store, std::uint64_t session) {
  std::uint64_t count = 0;
  const auto last = ReadJournal(store, session, 0, [&count](std::uint64_t position, JournalEntry&&) -> Result<void> {
    EXPECT_EQ(position, ++count);
    return {};
  });
  EXPECT_TRUE(last) << last.error().message;
  return count;
}

// How many entries of a session are said to be on the disk.
struct Followed {
  std::atomic<std::int64_t> through{-1};  // -1: not even the session itself.
  Journal::Durable durable() {
    return [this](const std::vector<JournalEntry>& entries) {
      through = std::max<std::int64_t>(through, 0) + static_cast<std::int64_t>(entries.size());
    };
  }
};

}  // namespace cairn::server::testing
