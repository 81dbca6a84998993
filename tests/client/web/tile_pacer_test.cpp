// How often somebody who looks at a map is told of a tile that changes all the time.
#include "client/web/tile_pacer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace cairn::web {
namespace {

using client::TileChanges;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

// Tells of changes at times of a clock that the test sets.
class Told : public ::testing::Test {
 protected:
  // The tile's x and its version, 0 for one that was removed.
  using Tiles = std::vector<std::pair<int, std::uint64_t>>;

  Tiles At(milliseconds time, const Tiles& changed, bool whole = false) {
    TileChanges changes{.now = {}, .whole = whole, .changed = {}};
    for (const auto& [x, version] : changed)
      changes.changed.push_back({.key = {0, x, 0}, .version = version, .removed = version == 0});
    const TileChanges next = pacer_.Next(changes, TilePacer::Clock::time_point(time));
    EXPECT_EQ(next.whole, whole);
    Tiles told;
    for (const auto& change : next.changed) told.emplace_back(change.key.x, change.removed ? 0 : change.version);
    return told;
  }

  TilePacer pacer_;
};

TEST_F(Told, ATileAtMostOnceASecondAndOfSeveralChangesTheNewest) {
  EXPECT_THAT(At(milliseconds(5000), {{1, 1}}), ElementsAre(Pair(1, 1))) << "the first one at once";
  EXPECT_THAT(At(milliseconds(5250), {{1, 2}}), IsEmpty());
  EXPECT_THAT(At(milliseconds(5500), {{1, 3}}), IsEmpty());
  EXPECT_THAT(At(milliseconds(5999), {}), IsEmpty());
  EXPECT_THAT(At(milliseconds(6000), {}), ElementsAre(Pair(1, 3))) << "the last change is told though none follows";
  EXPECT_THAT(At(milliseconds(7000), {}), IsEmpty()) << "and once";
  EXPECT_THAT(At(milliseconds(7500), {{1, 4}}), ElementsAre(Pair(1, 4)));
}

TEST_F(Told, TilesDoNotWaitForEachOther) {
  EXPECT_THAT(At(milliseconds(0), {{1, 1}}), ElementsAre(Pair(1, 1)));
  EXPECT_THAT(At(milliseconds(500), {{1, 2}, {2, 2}}), ElementsAre(Pair(2, 2)));
  EXPECT_THAT(At(milliseconds(1000), {{2, 3}}), ElementsAre(Pair(1, 2)));
  EXPECT_THAT(At(milliseconds(1500), {}), ElementsAre(Pair(2, 3)));
}

TEST_F(Told, ATileThatIsRemovedIsAChangeLikeOthers) {
  EXPECT_THAT(At(milliseconds(0), {{1, 1}}), ElementsAre(Pair(1, 1)));
  EXPECT_THAT(At(milliseconds(200), {{1, 2}}), IsEmpty());
  EXPECT_THAT(At(milliseconds(400), {{1, 0}}), IsEmpty());
  EXPECT_THAT(At(milliseconds(1000), {}), ElementsAre(Pair(1, 0)));
}

// With a new epoch, or after a restart of the server, what the viewer has is void.
TEST_F(Told, AWholeMapAtOnceAndNothingOfTheMapBefore) {
  EXPECT_THAT(At(milliseconds(0), {{1, 7}, {2, 7}}), ElementsAre(Pair(1, 7), Pair(2, 7)));
  EXPECT_THAT(At(milliseconds(200), {{2, 8}}), IsEmpty());
  EXPECT_THAT(At(milliseconds(400), {{1, 1}}, true), ElementsAre(Pair(1, 1)));
  EXPECT_THAT(At(milliseconds(1300), {{1, 2}}), IsEmpty());
  EXPECT_THAT(At(milliseconds(1400), {}), ElementsAre(Pair(1, 2)));
  EXPECT_THAT(At(milliseconds(1500), {}, true), IsEmpty()) << "an empty map is told as well";
}

}  // namespace
}  // namespace cairn::web
