#include "server/robots/unclaimed_streams.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

TEST(UnclaimedStreams, CountsPerStreamUpToItsBoundAndTheRestTogether) {
  UnclaimedStreams unclaimed(2);
  for (NameId robot = 1; robot <= 5; ++robot) unclaimed.Count({robot, 1, 9}, 1, DropReason::kNoSession);
  EXPECT_EQ(unclaimed.TakeChanged().size(), 2U);
  EXPECT_TRUE(unclaimed.TakeChanged().empty());
  EXPECT_EQ(unclaimed.overflow(), 3U);
}

TEST(UnclaimedStreams, AClaimTakesTheAccountAway) {
  UnclaimedStreams unclaimed(2);
  unclaimed.Count({1, 1, 9}, 1, DropReason::kNoSession);
  unclaimed.Count({1, 1, 9}, 2, DropReason::kNoSession);
  auto account = unclaimed.Claim(1, 1);
  ASSERT_TRUE(account);
  EXPECT_EQ(account->ledger().received, 2U);
  EXPECT_EQ(account->ledger().last_sequence, 2U);
  EXPECT_FALSE(unclaimed.Claim(1, 1));
}

}  // namespace
}  // namespace cairn::server
