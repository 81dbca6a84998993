#include "server/slam/site/relation_book.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace cairn::slam {
namespace {

constexpr RelationBook::Pair kPair{3, 8};
constexpr auto kRevisit = MeasurementKind::kRevisit;

Measurement Found(std::uint64_t seen, double x_m = 1.0) {
  return {.known = {seen + 100, 5},
          .seen = {seen, static_cast<Stamp>(10 * seen)},
          .guess = {x_m, 0.0, 0.0},
          .way_m = 2.0,
          .known_made = 200,
          .seen_made = 50,
          .found = true,
          .T_known_seen = {x_m + 0.01, 0.02, 0.03},
          .covariance = PoseCovariance(0.1, 0.02)};
}
Measurement NotFound(std::uint64_t seen) {
  Measurement one = Found(seen);
  one.found = false;
  return one;
}
const Measurement* At(RelationBook& book, std::uint64_t seen, const RelationBook::Pair& pair = kPair) {
  return book.Find(pair, kRevisit, {seen, static_cast<Stamp>(10 * seen)});
}
bool Everybody(std::uint64_t) {
  return true;
}

TEST(RelationBook, KeepsWhatWasMeasuredAndWhatWasNotFoundAndReplacesItByWhatIsMeasuredLater) {
  RelationBook book;
  book.Note(kPair, kRevisit, Found(1));
  book.Note(kPair, kRevisit, NotFound(2));
  ASSERT_NE(At(book, 1), nullptr);
  EXPECT_EQ(At(book, 1)->T_known_seen, (Pose2{1.01, 0.02, 0.03}));
  ASSERT_NE(At(book, 2), nullptr);
  EXPECT_FALSE(At(book, 2)->found);
  EXPECT_EQ(At(book, 3), nullptr);
  EXPECT_EQ(At(book, 1, {8, 3}), nullptr) << "the other way round is another measurement";
  EXPECT_EQ(book.Find(kPair, MeasurementKind::kStretch, {1, 10}), nullptr);
  book.Note(kPair, kRevisit, Found(2, 7.0));
  EXPECT_TRUE(At(book, 2)->found);
  EXPECT_EQ(book.size(), 2U);
  EXPECT_EQ(book.measured(), 3U);
}

// After a restart with other options a session can have another keyframe of the same number.
TEST(RelationBook, AKeyframeIsTheSameOnlyWithItsStamp) {
  RelationBook book;
  book.Note(kPair, kRevisit, Found(1));
  EXPECT_EQ(book.Find(kPair, kRevisit, {1, 11}), nullptr);
}

TEST(RelationBook, KnowsThePathsOfTheLastJobWhileTheirSessionsExist) {
  RelationBook book;
  EXPECT_EQ(book.PathOf(3), nullptr);
  for (const std::uint64_t session : {3, 8})
    book.SetPath(session, {.frame = 3, .keyframes = {{0, 5}}, .path = {{1.0, 0.0, 0.0}}});
  ASSERT_NE(book.PathOf(8), nullptr);
  EXPECT_EQ(book.PathOf(8)->frame, 3U);
  book.EndJob([](std::uint64_t session) { return session == 3; });
  EXPECT_NE(book.PathOf(3), nullptr);
  EXPECT_EQ(book.PathOf(8), nullptr);
  book.ForgetPath(3);
  EXPECT_EQ(book.PathOf(3), nullptr);
}

TEST(RelationBook, WhatWasNotBelievedIsLookedAtAgainWhenTheGuessHasMoved) {
  Measurement one = Found(1);
  EXPECT_TRUE(one.Holds({1.05, 0.0, 0.01}, 4.0));
  EXPECT_FALSE(one.Holds({1.2, 0.0, 0.0}, 2.0));
  EXPECT_FALSE(one.Holds({1.0, 0.0, 0.05}, 2.0));
  EXPECT_FALSE(one.Holds(one.guess, 8.0)) << "more doubt, so it is looked for farther away";
  one.believed = true;
  EXPECT_TRUE(one.Holds({1.2, 0.0, 0.05}, 20.0));
}

TEST(RelationBook, WithdrawnRelationsStayAsWithdrawn) {
  RelationBook book;
  for (const std::uint64_t seen : {1, 2}) book.Note(kPair, kRevisit, Found(seen));
  book.Note(kPair, kRevisit, NotFound(3));
  book.SetBelieved(kPair, [](const Measurement& one) { return one.seen.number != 2; });
  std::vector<std::uint64_t> believed;
  book.ForEachBelieved(kPair, [&](const Measurement& one) { believed.push_back(one.seen.number); });
  EXPECT_EQ(believed, (std::vector<std::uint64_t>{1}));
  ASSERT_NE(At(book, 2), nullptr);
  EXPECT_TRUE(At(book, 2)->found && !At(book, 2)->believed);
}

TEST(RelationBook, ForgetsSessionsThatAreRemoved) {
  RelationBook book;
  book.Note(kPair, kRevisit, Found(1));
  book.Note({3, 9}, kRevisit, Found(1));
  static_cast<void>(book.TakeChanged());
  book.EndJob([](std::uint64_t session) { return session != 8; });
  EXPECT_EQ(At(book, 1), nullptr);
  EXPECT_NE(At(book, 1, {3, 9}), nullptr);
  EXPECT_EQ(book.size(), 1U);
  EXPECT_EQ(book.TakeChanged(), (std::vector<RelationBook::Pair>{kPair}));
  EXPECT_TRUE(book.BytesOf(kPair).empty()) << "its record is to be removed";
}

TEST(RelationBook, IsBoundedAndGivesUpWhatWasNotUsedForLongest) {
  RelationBook book(10);
  for (std::uint64_t seen = 0; seen < 10; ++seen) book.Note(kPair, kRevisit, Found(seen));
  book.EndJob(Everybody);
  EXPECT_EQ(book.size(), 10U);
  book.BeginJob();
  for (const std::uint64_t seen : {0, 1, 2}) EXPECT_NE(At(book, seen), nullptr);
  for (std::uint64_t seen = 20; seen < 27; ++seen) book.Note(kPair, kRevisit, Found(seen));
  book.EndJob(Everybody);
  EXPECT_EQ(book.size(), 10U);
  EXPECT_NE(At(book, 1), nullptr);
  EXPECT_EQ(At(book, 5), nullptr);
  EXPECT_NE(At(book, 26), nullptr);
}

TEST(RelationBook, IsTheSameAfterItsBytes) {
  RelationBook book;
  book.Note(kPair, kRevisit, Found(1));
  book.Note(kPair, MeasurementKind::kPlace, NotFound(2));
  book.SetBelieved(kPair, [](const Measurement&) { return true; });
  const std::string bytes = book.BytesOf(kPair);
  RelationBook again;
  ASSERT_TRUE(again.Restore(kPair, bytes));
  EXPECT_EQ(again.size(), 2U);
  EXPECT_EQ(again.BytesOf(kPair), bytes);
  ASSERT_NE(At(again, 1), nullptr);
  EXPECT_TRUE(At(again, 1)->believed);
  EXPECT_EQ(At(again, 1)->covariance, Found(1).covariance);
  EXPECT_TRUE(again.TakeChanged().empty()) << "what was read need not be written";
}

TEST(RelationBook, DamagedBytesAreAnErrorAndChangeNothing) {
  RelationBook book;
  book.Note(kPair, kRevisit, Found(1));
  const std::string bytes = book.BytesOf(kPair);
  RelationBook other;
  other.Note(kPair, kRevisit, Found(9));
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_FALSE(other.Restore(kPair, std::string_view(bytes).substr(0, length))) << length;
  EXPECT_FALSE(other.Restore(kPair, bytes + "x"));
  // Any byte may be wrong: it is refused, or it is another number.
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    RelationBook third;
    static_cast<void>(third.Restore(kPair, damaged));
    EXPECT_LE(third.size(), 1U);
  }
  EXPECT_NE(At(other, 9), nullptr);
  EXPECT_EQ(other.size(), 1U);
}

}  // namespace
}  // namespace cairn::slam
