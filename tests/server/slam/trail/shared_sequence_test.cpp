#include "server/slam/trail/shared_sequence.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

SharedSequence<int> Counting(int size) {
  SharedSequence<int> sequence;
  for (int i = 0; i < size; ++i) sequence.Append(i);
  return sequence;
}

TEST(SharedSequence, KeepsEveryElementAsItGrowsByStoreys) {
  const SharedSequence<int> sequence = Counting(5000);
  ASSERT_EQ(sequence.size(), 5000U);
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(sequence[static_cast<std::size_t>(i)], i);
}

TEST(SharedSequence, ChangingACopyLeavesTheOriginalAlone) {
  SharedSequence<int> original = Counting(300);
  SharedSequence<int> copy = original;
  copy.Mutable(17) = -1;
  copy.Append(300);
  EXPECT_EQ(original[17], 17);
  EXPECT_EQ(original.size(), 300U);
  EXPECT_EQ(copy[17], -1);
  EXPECT_EQ(copy[300], 300);
}

TEST(SharedSequence, CopiesShareWhatTheyDoNotChange) {
  SharedSequence<int> original = Counting(300);
  SharedSequence<int> copy = original;
  copy.Mutable(17) = -1;
  EXPECT_EQ(&original[250], &copy[250]);  // In another leaf, both share one object in memory.
  EXPECT_NE(&original[17], &copy[17]);
}

TEST(SharedSequence, RewrittenTogetherTheyShareAgain) {
  SharedSequence<int> one = Counting(300);
  SharedSequence<int> other = one;
  other.Mutable(17) = -1;
  const SharedSequence<int> before = one;
  SharedSequence<int>::Rewritten done;
  const auto change = [](std::size_t index, int& value) {
    if (index != 17 && index < 300) {
      EXPECT_EQ(value, static_cast<int>(index));
    }
    value += 1000;
  };
  for (SharedSequence<int>* sequence : {&one, &other}) sequence->Rewrite(change, done);
  EXPECT_EQ(one[17], 1017);
  EXPECT_EQ(other[17], 999);
  EXPECT_EQ(other[299], 1299);
  EXPECT_EQ(&one[250], &other[250]);
  EXPECT_EQ(before[250], 250);
  one.Append(5);
  EXPECT_EQ(one[300], 5);
  EXPECT_EQ(other.size(), 300U);
}

TEST(SharedSequence, WritesInPlaceWhenNobodySharesTheNode) {
  SharedSequence<int> sequence = Counting(40);
  const int* before = &sequence[20];
  sequence.Mutable(20) = 7;
  EXPECT_EQ(before, &sequence[20]);
}

}  // namespace
}  // namespace cairn::slam
