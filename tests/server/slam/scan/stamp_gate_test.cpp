#include "server/slam/scan/stamp_gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

namespace cairn::slam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

// Jumps of more than 10 ns need three stamps that agree. The samples are their own stamps.
class StampGateTest : public testing::Test {
 protected:
  void Add(Stamp stamp, std::uint64_t sequence = 0) { gate_.Add(stamp, sequence, Stamp{stamp}); }

  std::vector<Stamp> passed_;
  std::vector<std::pair<Stamp, DropReason>> refused_;
  int set_back_ = 0;
  StampGate<Stamp> gate_{
      10,
      3,
      {.pass = [this](Stamp&& stamp) { passed_.push_back(stamp); },
       .refuse = [this](const Stamp& stamp, DropReason reason) { refused_.emplace_back(stamp, reason); },
       .set_back = [this](Stamp) { ++set_back_; }}};
};

TEST_F(StampGateTest, TheFirstStampPassesWhateverItIs) {
  Add(std::numeric_limits<Stamp>::min());
  EXPECT_THAT(passed_, ElementsAre(std::numeric_limits<Stamp>::min()));
}

TEST_F(StampGateTest, AStepOfExactlyTheLargestJumpPassesAtOnce) {
  Add(0);
  Add(10);
  EXPECT_THAT(passed_, ElementsAre(0, 10));
  Add(21);
  EXPECT_THAT(passed_, ElementsAre(0, 10));  // Held back.
  EXPECT_THAT(refused_, IsEmpty());
}

TEST_F(StampGateTest, AheadStampsThatFollowEachOtherByTheLargestJumpAgree) {
  for (const Stamp stamp : {0, 1000, 1010, 1020}) Add(stamp);
  EXPECT_THAT(passed_, ElementsAre(0, 1000, 1010, 1020));
  EXPECT_EQ(set_back_, 0);
}

TEST_F(StampGateTest, AStampThatRepeatsAgreesWithNothing) {
  for (const Stamp stamp : {100, 1000, 1000, 1000}) Add(stamp);
  EXPECT_THAT(passed_, ElementsAre(100));
  for (const Stamp stamp : {50, 50, 50, 50}) Add(stamp);
  EXPECT_THAT(passed_, ElementsAre(100));
  EXPECT_EQ(set_back_, 0);
}

TEST_F(StampGateTest, AClockSetBackIsBelievedAtTheThirdStampThatFollows) {
  for (const Stamp stamp : {100, 50, 51}) Add(stamp);
  EXPECT_THAT(passed_, ElementsAre(100));
  Add(52);
  EXPECT_THAT(passed_, ElementsAre(100, 52));
  EXPECT_EQ(set_back_, 1);
  EXPECT_THAT(refused_, ElementsAre(Pair(50, DropReason::kStampWentBack), Pair(51, DropReason::kStampWentBack)));
  Add(53);
  EXPECT_THAT(passed_, ElementsAre(100, 52, 53));
  EXPECT_EQ(set_back_, 1);
}

TEST_F(StampGateTest, EarlierStampsThatDoNotFollowEachOtherProveNothing) {
  for (const Stamp stamp : {100, 20, 50, 80, 30, 60, 90}) Add(stamp);
  EXPECT_THAT(passed_, ElementsAre(100));
  EXPECT_EQ(set_back_, 0);
}

TEST_F(StampGateTest, AnythingElseBetweenThemBeginsTheCountAnew) {
  for (const Stamp stamp : {100, 50, 51, 101, 52}) Add(stamp);  // The old time goes on.
  EXPECT_THAT(passed_, ElementsAre(100, 101));
  for (const Stamp stamp : {53, 1000, 54}) Add(stamp);  // A stamp far ahead.
  EXPECT_THAT(passed_, ElementsAre(100, 101));
  EXPECT_EQ(set_back_, 0);
}

TEST_F(StampGateTest, EarlierStampsWithNumbersUpToTheLastOneAreLateAndNoClock) {
  Add(100, 5);
  for (const Stamp stamp : {50, 51, 52, 53}) Add(stamp, 5);
  for (const Stamp stamp : {54, 55, 56, 57}) Add(stamp, 4);
  EXPECT_THAT(passed_, ElementsAre(100));
  for (const Stamp stamp : {58, 59, 60}) Add(stamp, 6);
  EXPECT_THAT(passed_, ElementsAre(100, 60));
}

TEST_F(StampGateTest, ANewClientsNumbersAreNotComparedWithTheOldOnes) {
  Add(100, 5);
  gate_.NewClient();
  for (std::uint64_t number = 1; number <= 3; ++number) Add(50 + static_cast<Stamp>(number), number);
  EXPECT_THAT(passed_, ElementsAre(100, 53));
  EXPECT_EQ(set_back_, 1);
}

}  // namespace
}  // namespace cairn::slam
