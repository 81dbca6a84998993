#include "client/cli/scan_account.h"

#include <gtest/gtest.h>

#include "client/cli/json_output.h"

namespace cairn::client {
namespace {

Ledger MakeLedger(std::uint64_t received, std::uint64_t used, std::uint64_t no_odometry) {
  Ledger ledger;
  ledger.received = received;
  ledger.used = used;
  ledger.dropped[static_cast<std::size_t>(DropReason::kNoOdometry)] = no_odometry;
  return ledger;
}

TEST(ScanAccount, CountsOnlyWhatHappenedSinceTheStart) {
  const ScanAccount account = AccountScans(50, MakeLedger(100, 90, 10), MakeLedger(150, 137, 13));
  EXPECT_EQ(account.used, 47u);
  EXPECT_EQ(account.dropped_total(), 3u);
  EXPECT_EQ(account.unexplained(), 0);
}

TEST(ScanAccount, FindsScansNobodyExplains) {
  EXPECT_EQ(AccountScans(50, {}, MakeLedger(48, 48, 0)).unexplained(), 2);
  EXPECT_EQ(AccountScans(50, {}, MakeLedger(51, 51, 0)).unexplained(), -1);
}

TEST(ScanAccount, ScansThatWaitAreExplained) {
  Ledger after = MakeLedger(50, 45, 0);
  after.waiting = 5;
  EXPECT_EQ(AccountScans(50, {}, after).unexplained(), 0);
}

TEST(ScanAccount, AServerThatForgotCountsFromZero) {
  EXPECT_EQ(AccountScans(50, MakeLedger(1000, 1000, 0), MakeLedger(50, 50, 0)).unexplained(), 0);
}

TEST(ScanAccount, NamesTheReasons) {
  const ScanAccount account = AccountScans(13, {}, MakeLedger(13, 10, 2));
  EXPECT_EQ(FormatAccount(account),
            "sent 13, used 10 (0 keyframes), dropped 2 (no_odometry 2), waiting 0, unexplained 1");
  const nlohmann::json json = nlohmann::json(account);
  EXPECT_EQ(json["dropped"], (nlohmann::json{{"no_odometry", 2}}));
  EXPECT_EQ(json["unexplained"], 1);
}

}  // namespace
}  // namespace cairn::client
