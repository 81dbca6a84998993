#include "server/robots/unclaimed_streams.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

constexpr UnclaimedStreams::Clock::time_point kNow{std::chrono::hours(5)};

TEST(UnclaimedStreams, CountsPerStreamUpToItsBoundAndTheRestTogether) {
  UnclaimedStreams unclaimed(2);
  for (NameId robot = 1; robot <= 5; ++robot) unclaimed.Count({robot, 1, 9}, 1, DropReason::kNoSession, kNow);
  EXPECT_EQ(unclaimed.TakeChanged().size(), 2U);
  EXPECT_TRUE(unclaimed.TakeChanged().empty());
  EXPECT_EQ(unclaimed.overflow(), 3U);
}

// Names typed wrongly once filled the table for ever.
TEST(UnclaimedStreams, SilentStreamsAreForgotten) {
  UnclaimedStreams unclaimed(2);
  const auto later = kNow + UnclaimedStreams::kForgottenAfter + std::chrono::seconds(1);
  unclaimed.Count({1, 1, 9}, 1, DropReason::kNoSession, kNow);
  unclaimed.Count({2, 1, 9}, 1, DropReason::kNoSession, kNow);
  unclaimed.Count({2, 1, 9}, 2, DropReason::kNoSession, later);
  std::vector<NameId> retired;
  const auto retire = [&](const Ledger& ledger) {
    retired.push_back(ledger.robot_id);
    return retired.size() > 1;  // There is no room for the first.
  };
  unclaimed.ForgetSilent(kNow, retire);
  EXPECT_TRUE(retired.empty());
  unclaimed.ForgetSilent(later, retire);
  unclaimed.ForgetSilent(later, retire);
  unclaimed.ForgetSilent(later, retire);
  EXPECT_EQ(retired, (std::vector<NameId>{1, 1}));
  unclaimed.Count({3, 1, 9}, 1, DropReason::kNoSession, later);
  EXPECT_EQ(unclaimed.overflow(), 0U);
}

TEST(UnclaimedStreams, AClaimTakesTheAccountAway) {
  UnclaimedStreams unclaimed(2);
  unclaimed.Count({1, 1, 9}, 1, DropReason::kNoSession, kNow);
  unclaimed.Count({1, 1, 9}, 2, DropReason::kNoSession, kNow);
  auto account = unclaimed.Claim({1, 1, 9});
  ASSERT_TRUE(account);
  EXPECT_EQ(account->ledger().received, 2U);
  EXPECT_EQ(account->ledger().last_sequence, 2U);
  EXPECT_FALSE(unclaimed.Claim({1, 1, 9}));
}

// A stranger who had sent scan 40 under the robot's name made the owner's first forty scans look like duplicates; they
// were never settled, and the owner waited at its window for ever.
TEST(UnclaimedStreams, TheOwnersNumbersStartAnewAfterAStranger) {
  UnclaimedStreams unclaimed(2);
  unclaimed.Count({1, 1, 9}, 40, DropReason::kNoSession, kNow);
  auto account = unclaimed.Claim({1, 1, 7});
  ASSERT_TRUE(account);
  EXPECT_TRUE(account->Received(1));
  account->Used(1, 1, false, 1.0);
  EXPECT_EQ(account->ledger().settled_through, 1U);
  EXPECT_EQ(account->ledger().received, 2U);
}

TEST(UnclaimedStreams, TheOwnersOwnNumbersGoOn) {
  UnclaimedStreams unclaimed(2);
  unclaimed.Count({1, 1, 7}, 1, DropReason::kNoSession, kNow);
  unclaimed.Count({1, 1, 7}, 2, DropReason::kNoSession, kNow);
  auto account = unclaimed.Claim({1, 1, 7});
  ASSERT_TRUE(account);
  EXPECT_FALSE(account->Received(2));
  EXPECT_TRUE(account->Received(3));
}

TEST(UnclaimedStreams, EachOfTwoStrangersHasNumbersOfItsOwn) {
  UnclaimedStreams unclaimed(2);
  unclaimed.Count({1, 1, 8}, 500, DropReason::kNoSession, kNow);
  unclaimed.Count({1, 1, 9}, 1, DropReason::kNoSession, kNow);
  unclaimed.Count({1, 1, 9}, 1, DropReason::kNoSession, kNow);  // Sent again: no news.
  unclaimed.Count({1, 1, 9}, 77, DropReason::kNotOwner, kNow);
  const Ledger ledger = unclaimed.Claim({1, 1, 7})->ledger();
  EXPECT_EQ(ledger.received, 3U);
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kNoSession)], 2U);
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kNotOwner)], 1U);
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kLostOnWire)], 0U);
  EXPECT_EQ(ledger.waiting, 0U);
}

}  // namespace
}  // namespace cairn::server
