#include "client/lib/scan_window.h"

#include <gtest/gtest.h>

namespace cairn::client {
namespace {

Ledger Settled(std::uint64_t through, std::uint64_t durable = 0) {
  Ledger ledger;
  ledger.last_sequence = through;
  ledger.settled_through = through;
  ledger.durable_through = durable;
  return ledger;
}

void AddScans(ScanWindow& window, int count) {
  for (int i = 0; i < count; ++i) window.Add({});
}

TEST(ScanWindow, NumbersScansFromOne) {
  ScanWindow window({});
  EXPECT_EQ(window.Add({})->scan.sequence, 1U);
  EXPECT_EQ(window.Add({})->scan.sequence, 2U);
  ScanSample numbered;
  numbered.scan.sequence = 10;
  EXPECT_EQ(window.Add(std::move(numbered))->scan.sequence, 10U);
  EXPECT_EQ(window.Add({})->scan.sequence, 11U);
}

TEST(ScanWindow, IsFullAtItsLimitUntilTheServerSettles) {
  ScanWindow window({.window = 4});
  AddScans(window, 4);
  EXPECT_FALSE(window.HasRoom());
  window.OnLedger(Settled(1));
  EXPECT_TRUE(window.HasRoom());
  AddScans(window, 1);
  EXPECT_FALSE(window.HasRoom());
}

TEST(ScanWindow, WithoutALimitAlwaysHasRoom) {
  ScanWindow window({.window = 0, .kept_scans = 8});
  AddScans(window, 100);
  EXPECT_TRUE(window.HasRoom());
}

TEST(ScanWindow, KeepsWhatIsNotSettledOfAServerWithoutAStore) {
  ScanWindow window({});
  AddScans(window, 10);
  window.OnLedger(Settled(7));
  ASSERT_EQ(window.kept().size(), 3U);
  EXPECT_EQ(window.kept()[0]->scan.sequence, 8U);
}

TEST(ScanWindow, KeepsWhatIsSettledButNotDurableOfAServerWithAStore) {
  ScanWindow window({});
  AddScans(window, 10);
  window.OnLedger(Settled(8, 5));
  ASSERT_EQ(window.kept().size(), 5U);
  EXPECT_EQ(window.kept()[0]->scan.sequence, 6U);
}

TEST(ScanWindow, ForgetsTheOldestBeyondItsBoundAndSaysSo) {
  ScanWindow window({.window = 0, .kept_scans = 4});
  AddScans(window, 6);
  EXPECT_EQ(window.kept().size(), 4U);
  EXPECT_EQ(window.forgotten(), 2U);
}

TEST(ScanWindow, IgnoresTheLedgerOfAnEarlierClient) {
  ScanWindow window({.window = 4});
  AddScans(window, 4);
  window.OnLedger(Settled(500));
  EXPECT_FALSE(window.HasRoom());
  EXPECT_EQ(window.kept().size(), 4U);
}

TEST(ScanWindow, ClosesForAServerThatLostItsMemory) {
  ScanWindow window({.window = 4});
  AddScans(window, 4);
  window.OnLedger(Settled(4));
  EXPECT_TRUE(window.settled());
  window.OnLedger(Settled(0));
  EXPECT_FALSE(window.HasRoom());
  EXPECT_FALSE(window.settled());
}

}  // namespace
}  // namespace cairn::client
