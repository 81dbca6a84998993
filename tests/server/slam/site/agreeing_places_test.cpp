#include "server/slam/site/agreeing_places.h"

#include <gtest/gtest.h>

#include "tests/server/slam/site/two_sessions.h"

namespace cairn::slam {
namespace {

using test::RingSession;
using test::TestSession;

const GoOn kGoesOn = [] { return true; };

struct PlacesOfTwo : ::testing::Test {
  std::vector<SessionRelation> Find(TestSession& one, TestSession& other, bool soon_again = false,
                                    const GoOn& go_on = kGoesOn) {
    return AgreeingPlaces(one.number, *one.map, other.number, *other.map, options.loop, soon_again, go_on, book);
  }

  const test::World world = test::RingCorridor(true);
  TestSession a = RingSession(0, world, 0.0, 50.0, {});
  const SiteOptions options = SiteOptionsOf(MapperOptions{});
  RelationBook book;
};

TEST_F(PlacesOfTwo, ProveThatBothHaveBeenThere) {
  TestSession around = RingSession(0, world, 0.0, 110.0, {}), b = RingSession(1, world, 30.0, 80.0, {5.0, 5.0, 1.0});
  const auto relations = Find(around, b);
  ASSERT_GE(relations.size(), 3U);
  for (const SessionRelation& one : relations) {
    EXPECT_EQ(one.from.session, 0U);
    EXPECT_EQ(one.to.session, 1U);
    EXPECT_LT(test::ErrorOfRelation(one, around, b), 0.15);
  }
  EXPECT_LT(book.measured(), PlacesToLookFor(*around.map).size() + PlacesToLookFor(*b.map).size())
      << "the first proof is enough";
}

TEST_F(PlacesOfTwo, AreNoProofWhereTheyCoverLittleWay) {
  TestSession b = RingSession(1, world, 36.0, 50.0, {5.0, 5.0, 1.0});
  EXPECT_TRUE(Find(a, b).empty()) << "14 m are shared";
  std::size_t found = 0;
  for (const std::size_t place : PlacesToLookFor(*a.map))
    found += RecognisePlace(1, *b.map, 0, *a.map, place, options.loop, book) ? 1 : 0;
  EXPECT_GT(found, 0U) << "although something is recognised";
}

// Who will be asked again soon looks at half of the places and no more, where these show nothing.
TEST_F(PlacesOfTwo, ThatWillSoonBeLookedForAgainAreGivenUpEarlier) {
  TestSession elsewhere = RingSession(1, test::RingCorridor(true, 77), 0.0, 50.0, {5.0, 5.0, 1.0});
  EXPECT_TRUE(Find(a, elsewhere).empty());
  const std::size_t all = book.measured();
  EXPECT_EQ(all, PlacesToLookFor(*a.map).size() + PlacesToLookFor(*elsewhere.map).size());
  book = RelationBook();
  EXPECT_TRUE(Find(a, elsewhere, true).empty());
  EXPECT_GE(book.measured(), all / 2);
  EXPECT_LE(book.measured(), all / 2 + 2);
}

TEST_F(PlacesOfTwo, BeginWithTheNewestThatWillSoonBeLookedForAgain) {
  TestSession elsewhere = RingSession(1, test::RingCorridor(true, 77), 0.0, 50.0, {5.0, 5.0, 1.0});
  const auto places = PlacesToLookFor(*elsewhere.map);
  for (const bool soon_again : {false, true}) {
    book = RelationBook();
    const auto first_only = [this] { return book.measured() == 0; };
    EXPECT_TRUE(Find(a, elsewhere, soon_again, first_only).empty());
    const KeyframeId first = elsewhere.map->id(soon_again ? places.back() : places.front());
    EXPECT_NE(book.Find({1, 2}, MeasurementKind::kPlace, first), nullptr);
    EXPECT_EQ(book.measured(), 1U) << "it ends when it is told to";
  }
}

}  // namespace
}  // namespace cairn::slam
