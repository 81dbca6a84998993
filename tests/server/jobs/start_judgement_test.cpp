#include "server/jobs/start_judgement.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

constexpr GridAgreement kContradicts{.compared = 200, .contradicted = 100};
constexpr GridAgreement kAgrees{.compared = 200, .contradicted = 10};
constexpr GridAgreement kTellsNothing{.compared = 20, .contradicted = 20};

TEST(StartJudgement, RefusesAfterTwoContradictionsInARow) {
  StartJudgement judgement;
  EXPECT_FALSE(judgement.Refuses(kContradicts, 7.0));
  EXPECT_FALSE(judgement.Refuses(kAgrees, 7.0));
  EXPECT_FALSE(judgement.Refuses(kContradicts, 7.0));
  EXPECT_TRUE(judgement.Refuses(kContradicts, 7.0));
}

TEST(StartJudgement, NearTheStartLessIsEnoughWhereMuchIsCompared) {
  const auto in_a_row = [](const GridAgreement& agreement, double way_m) {
    StartJudgement judgement;
    static_cast<void>(judgement.Refuses(agreement, way_m));
    return judgement.Refuses(agreement, way_m);
  };
  const GridAgreement fourth{.compared = 400, .contradicted = 100}, tenth{.compared = 400, .contradicted = 40};
  const GridAgreement fourth_of_few{.compared = 160, .contradicted = 40};
  EXPECT_TRUE(in_a_row(fourth, 5.0));
  EXPECT_FALSE(in_a_row(fourth, 6.0));
  EXPECT_FALSE(in_a_row(tenth, 5.0));
  EXPECT_FALSE(in_a_row(fourth_of_few, 5.0));
}

TEST(StartJudgement, AComparisonThatTellsNothingDoesNotTakeBackAContradiction) {
  StartJudgement judgement;
  EXPECT_FALSE(judgement.Refuses(kContradicts, 7.0));
  EXPECT_FALSE(judgement.Refuses(kTellsNothing, 7.0));
  EXPECT_FALSE(judgement.Refuses({}, 7.0));  // As while the map is being switched.
  EXPECT_TRUE(judgement.Refuses(kContradicts, 7.0));
}

}  // namespace
}  // namespace cairn::server
