#include "server/slam/site/relation_search.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/server/slam/site/two_sessions.h"

namespace cairn::slam {
namespace {

using test::ErrorOfRelation;
using test::RingSession;
using test::TestSession;

const GoOn kSearchesOn = [] { return true; };

struct SearchBetweenTwo : ::testing::Test {
  // Both stand at the same place at keyframe 25 of the first, and 0 of the second.
  [[nodiscard]] std::vector<SessionRelation> Nearby(const std::vector<Tie>& ties = {{25, 0}},
                                                    const GoOn& go_on = kSearchesOn) {
    return FindRelationsNearby(known.placed(), seen.placed(), ties, options, go_on, book);
  }

  const test::World world = test::RingCorridor(true);
  TestSession known = RingSession(0, world, 0.0, 30.0, {});
  TestSession seen = RingSession(1, world, 10.0, 30.0, {5.0, 5.0, 1.0});
  TestSession around = RingSession(0, world, 0.0, 110.0, {});
  TestSession far = RingSession(1, world, 30.0, 70.0, {5.0, 5.0, 1.0});
  const SiteOptions options = SiteOptionsOf(MapperOptions{});
  RelationBook book;
};

TEST_F(SearchBetweenTwo, RelatesWhatBothHaveSeenExactly) {
  const auto relations = Nearby();
  EXPECT_GT(relations.size(), 30U) << "of 50 keyframes near the other one's";
  for (const SessionRelation& one : relations) {
    EXPECT_EQ(one.from.session, 0U);
    EXPECT_EQ(one.to.session, 1U);
    EXPECT_LT(ErrorOfRelation(one, known, seen), 0.05) << one.to.keyframe;
    EXPECT_GE(one.covariance(0, 0), 0.01) << "maps of two sessions are bent in different ways";
  }
}

// The guess is off by more than what one scan may correct.
TEST_F(SearchBetweenTwo, FindsNothingWrongWhereTheGuessIsBad) {
  seen.Place({0.0, 1.6, 0.0});  // Across the corridor; along it one scan can not tell.
  const auto relations = Nearby();
  EXPECT_FALSE(relations.empty());
  for (const SessionRelation& one : relations) EXPECT_LT(ErrorOfRelation(one, known, seen), 0.2);
}

TEST_F(SearchBetweenTwo, TheNearerTheTieTheMoreIsFound) {
  const std::size_t near = Nearby().size();
  book = RelationBook();
  EXPECT_LT(Nearby({{0, seen.map->size() - 1}}).size(), near) << "one scan is no proof 25 m of way from a tie";
}

TEST_F(SearchBetweenTwo, LeavesOutKeyframesThatAreNotLocalized) {
  for (Keyframe& keyframe : seen.drive.snapshot.keyframes) keyframe.localized = false;
  const TestSession lost(1, seen.drive);
  const std::vector<Tie> ties{{25, 0}};
  EXPECT_TRUE(FindRelationsNearby(known.placed(), lost.placed(), ties, options, kSearchesOn, book).empty());
  EXPECT_TRUE(PlacesToLookFor(*lost.map).empty());
}

TEST_F(SearchBetweenTwo, IsNotMadeAgainWhereNothingHasChanged) {
  const auto relations = Nearby();
  book.BeginJob();
  const auto again = Nearby();
  EXPECT_EQ(book.measured(), 0U);
  EXPECT_GE(book.reused(), relations.size());
  ASSERT_EQ(again.size(), relations.size());
  for (std::size_t i = 0; i < again.size(); ++i) EXPECT_EQ(again[i].T_from_to, relations[i].T_from_to);
  // What found nothing is looked for again where the guess has moved.
  seen.Place({0.15, 0.0, 0.0});
  static_cast<void>(Nearby());
  EXPECT_GT(book.measured(), 0U);
}

TEST_F(SearchBetweenTwo, EndsWhenItIsToldTo) {
  int asked = 0;
  static_cast<void>(Nearby({{25, 0}}, [&asked] { return ++asked < 4; }));
  EXPECT_EQ(asked, 4);
  EXPECT_LE(book.measured(), 3U);
}

TEST_F(SearchBetweenTwo, PlacesToLookForAreMetresApart) {
  const auto places = PlacesToLookFor(*seen.map);
  ASSERT_EQ(places.size(), 6U) << "every 5 m of 30";
  for (std::size_t i = 1; i < places.size(); ++i)
    EXPECT_NEAR(seen.map->travelled_m(places[i]) - seen.map->travelled_m(places[i - 1]), 5.0, 0.5);
  const TestSession long_one = RingSession(2, world, 0.0, 320.0, {});
  const auto sparse = PlacesToLookFor(*long_one.map);
  EXPECT_LE(sparse.size(), 60U);
  EXPECT_NEAR(long_one.map->travelled_m(sparse[1]), 10.0, 0.5);
}

TEST_F(SearchBetweenTwo, APlaceIsRecognisedInTheWholeOtherMapWithoutAGuess) {
  std::size_t found = 0;
  for (const std::size_t keyframe : PlacesToLookFor(*far.map)) {
    const auto recognise = [&] { return RecognisePlace(0, *around.map, 1, *far.map, keyframe, options.loop, book); };
    book.BeginJob();
    const auto place = recognise();
    EXPECT_EQ(book.measured(), 1U);
    const auto again = recognise();
    EXPECT_EQ(book.measured(), 1U);
    EXPECT_EQ(book.reused(), 1U);
    EXPECT_EQ(again.has_value(), place.has_value());
    if (!place || !again) continue;  // Along a side of the ring a place looks like the one a little farther on.
    ++found;
    EXPECT_LT(ErrorOfRelation(*place, around, far), 0.15);
    EXPECT_GT(place->to.keyframe, keyframe) << "the last keyframe of the place";
    EXPECT_LT(FirstOfPlace(*far.map, keyframe), keyframe);
    EXPECT_EQ(again->T_from_to, place->T_from_to);
    EXPECT_EQ(again->from.keyframe, place->from.keyframe);
  }
  EXPECT_GE(found, 3U);
}

// Where the map in which nothing was found has grown by a quarter, it may be there now.
TEST_F(SearchBetweenTwo, APlaceIsLookedForAgainWhereTheOtherMapHasGrown) {
  const auto places = PlacesToLookFor(*far.map);
  const auto seen_around = std::ranges::find_if(places, [&](std::size_t keyframe) {
    RelationBook nothing;
    return RecognisePlace(0, *around.map, 1, *far.map, keyframe, options.loop, nothing).has_value();
  });
  ASSERT_NE(seen_around, places.end());
  const auto in = [&](TestSession& map) {
    return RecognisePlace(0, *map.map, 1, *far.map, *seen_around, options.loop, book).has_value();
  };
  TestSession before = RingSession(0, world, 0.0, 12.0, {}), little_more = RingSession(0, world, 0.0, 13.0, {});
  EXPECT_FALSE(in(before));
  EXPECT_FALSE(in(little_more));
  EXPECT_EQ(book.measured(), 1U);
  EXPECT_TRUE(in(around));
  EXPECT_EQ(book.measured(), 2U);
}

}  // namespace
}  // namespace cairn::slam
