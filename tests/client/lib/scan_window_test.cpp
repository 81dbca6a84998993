#include "client/lib/scan_window.h"

#include <gtest/gtest.h>

namespace cairn::client {
namespace {

Ledger Settled(std::uint64_t through) {
  Ledger ledger;
  ledger.last_sequence = through;
  ledger.settled_through = through;
  return ledger;
}

void Give(ScanWindow& window, int count) {
  for (int i = 0; i < count; ++i) static_cast<void>(window.Next());
}

TEST(ScanWindow, NumbersFromOne) {
  ScanWindow window(0);
  EXPECT_EQ(window.Next(), 1U);
  EXPECT_EQ(window.Next(), 2U);
  window.TakeBack();
  EXPECT_EQ(window.Next(), 2U);
}

TEST(ScanWindow, NobodyWaitsForWhatIsGone) {
  ScanWindow window(4);
  Give(window, 10);
  EXPECT_FALSE(window.HasRoom(6));
  EXPECT_TRUE(window.HasRoom(7));
}

TEST(ScanWindow, IsFullAtItsLimitUntilTheServerSettles) {
  ScanWindow window(4);
  Give(window, 4);
  EXPECT_FALSE(window.HasRoom());
  window.OnLedger(Settled(1));
  EXPECT_TRUE(window.HasRoom());
  Give(window, 1);
  EXPECT_FALSE(window.HasRoom());
}

TEST(ScanWindow, WithoutALimitAlwaysHasRoom) {
  ScanWindow window(0);
  Give(window, 100);
  EXPECT_TRUE(window.HasRoom());
}

TEST(ScanWindow, ClosesForAServerThatLostItsMemory) {
  ScanWindow window(4);
  Give(window, 4);
  window.OnLedger(Settled(4));
  EXPECT_TRUE(window.settled());
  window.OnLedger(Settled(0));
  EXPECT_FALSE(window.HasRoom());
  EXPECT_FALSE(window.settled());
}

TEST(ScanWindow, BeginsANewSessionWithWhatIsKept) {
  ScanWindow window(4);
  Give(window, 100);
  window.OnLedger(Settled(98));
  window.Restart(2);
  EXPECT_EQ(window.settled_through(), 0U);
  EXPECT_EQ(window.Next(), 3U);
}

}  // namespace
}  // namespace cairn::client
