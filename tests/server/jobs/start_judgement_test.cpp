#include "server/jobs/start_judgement.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

constexpr GridAgreement kContradicts{.compared = 200, .contradicted = 100};
constexpr GridAgreement kAgrees{.compared = 200, .contradicted = 10};
constexpr GridAgreement kTellsNothing{.compared = 20, .contradicted = 20};

TEST(StartJudgement, RefusesAfterTwoContradictionsInARow) {
  StartJudgement judgement;
  EXPECT_FALSE(judgement.Refuses(kContradicts));
  EXPECT_FALSE(judgement.Refuses(kAgrees));
  EXPECT_FALSE(judgement.Refuses(kContradicts));
  EXPECT_TRUE(judgement.Refuses(kContradicts));
}

TEST(StartJudgement, AComparisonThatTellsNothingDoesNotTakeBackAContradiction) {
  StartJudgement judgement;
  EXPECT_FALSE(judgement.Refuses(kContradicts));
  EXPECT_FALSE(judgement.Refuses(kTellsNothing));
  EXPECT_FALSE(judgement.Refuses({}));  // As while the map is being switched.
  EXPECT_TRUE(judgement.Refuses(kContradicts));
}

}  // namespace
}  // namespace cairn::server
