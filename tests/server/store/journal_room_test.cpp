// Records of sites and jobs in the journal's queue, which has no room without end.
#include <gtest/gtest.h>

#include <atomic>

#include "server/store/journal.h"
#include "server/store/site_contents.h"
#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/store/faulty_vfs.h"
#include "tests/server/store/stored_sites.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// A map that changes for hours while the disk fails filled the queue with older forms of its record, and afterwards the
// server was called degraded until it was started again.
TEST(JournalRoom, ARecordThatChangesOftenWhileTheDiskFailsTakesTheRoomOfOne) {
  const TempDirectory directory;
  FaultyVfs vfs;
  const auto store = *OpenStore(directory.path(), FaultyVfs::name());
  Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
  journal.Start();
  vfs.Set(DiskFault::kFull);
  const auto put = [&journal](std::uint64_t owner, std::uint32_t epoch) {
    journal.Put({RecordKind::kSite, owner, 0}, [epoch] {
      StoredSite site;
      site.name = "lab";
      site.epoch = epoch;
      return BytesOf(site);
    });
  };
  put(1, 0);
  ASSERT_TRUE(test::Eventually([&] { return journal.health().degraded; }));
  for (std::uint32_t epoch = 1; epoch <= 20'000; ++epoch) put(HashName("lab"), epoch);
  vfs.Set(DiskFault::kNone);
  const auto stored_epoch = [&] {
    const auto read = ReadSite(*store, "lab");
    return read ? read->site.epoch : 0;
  };
  EXPECT_TRUE(test::Eventually([&] { return stored_epoch() == 20'000; }));
  EXPECT_TRUE(test::Eventually([&] { return !journal.health().degraded; })) << journal.health().reason;
}

// Whoever changes it hands it over whole, so that a later form makes up for one that found no room.
TEST(JournalRoom, WhatFoundNoRoomIsMissingUntilItsNextForm) {
  const auto store = MemoryStore();
  Journal journal(*store, {.commit_delay_ms = 1, .queue_mib = 1});
  const auto put = [&journal](std::uint64_t owner) {
    journal.Put({RecordKind::kSite, owner, 0}, [] {
      StoredSite site;
      site.name = "lab";
      return BytesOf(site);
    });
  };
  std::uint64_t last = 0;
  while (!journal.health().degraded && last < 10'000) put(++last);
  EXPECT_NE(journal.health().reason.find("no longer stored"), std::string::npos) << journal.health().reason;
  std::atomic<bool> stored = false;
  journal.WhenStored([&stored] { stored = true; });
  journal.Start();
  ASSERT_TRUE(test::Eventually([&] { return stored.load(); }));
  EXPECT_TRUE(journal.health().degraded);
  put(last);
  EXPECT_FALSE(journal.health().degraded) << journal.health().reason;
}

}  // namespace
}  // namespace cairn::server::testing
