// Requests for maps, and work of the door that ends with an exception.
#include "server/ros2/map_wishes.h"

#include <gtest/gtest.h>

#include <new>
#include <stdexcept>
#include <vector>

#include "server/ros2/failures.h"

namespace cairn::server {
namespace {

using Clock = MapWishes::Clock;
using std::chrono::seconds;

class Wishes : public ::testing::Test {
 protected:
  // A request that says, when it is answered, who asked and how many cells he got.
  MapWish Wish(std::uint64_t asker, NameId site = 1, bool until_known = false) {
    return {asker, site, until_known, now_ + seconds(2), [this, asker](const ros2::Grid& map) {
              if (!reachable_) return false;
              answered_.push_back(asker);
              cells_.push_back(map.cells.size());
              return true;
            }};
  }
  std::size_t Turn(std::size_t max_cells = 1000) {
    return wishes_.Answer(
        [this](NameId site) {
          ++made_;
          ros2::Grid map;
          map.cells.resize(site == 1 ? known_cells_ : 0);
          return map;
        },
        max_cells, now_);
  }

  MapWishes wishes_;
  Clock::time_point now_ = Clock::time_point() + std::chrono::hours(1);
  bool reachable_ = true;
  std::size_t known_cells_ = 100;
  int made_ = 0;
  std::vector<std::uint64_t> answered_;
  std::vector<std::size_t> cells_;
};

TEST_F(Wishes, AreAnsweredInOrderWithOneMapASite) {
  for (const std::uint64_t asker : {3U, 1U, 2U}) ASSERT_TRUE(wishes_.Add(Wish(asker)));
  EXPECT_EQ(Turn(), 0U);
  EXPECT_EQ(answered_, (std::vector<std::uint64_t>{3, 1, 2}));
  EXPECT_EQ(made_, 1);
  EXPECT_EQ(cells_, (std::vector<std::size_t>{100, 100, 100}));
  Turn();
  EXPECT_EQ(answered_.size(), 3U) << "each once";
}

TEST_F(Wishes, OneParticipantCannotTakeAllTheRoom) {
  for (std::size_t i = 0; i < MapWishes::kMostOfOne; ++i) EXPECT_TRUE(wishes_.Add(Wish(7)));
  EXPECT_FALSE(wishes_.Add(Wish(7)));
  for (std::uint64_t asker = 100; asker < 100 + MapWishes::kMost - MapWishes::kMostOfOne; ++asker)
    EXPECT_TRUE(wishes_.Add(Wish(asker)));
  EXPECT_FALSE(wishes_.Add(Wish(99)));
}

TEST_F(Wishes, ATurnGivesNoMoreCellsThanOneMessageMayHave) {
  for (std::uint64_t asker = 1; asker <= 5; ++asker) ASSERT_TRUE(wishes_.Add(Wish(asker)));
  Turn(150);
  EXPECT_EQ(answered_.size(), 2U);
  Turn(1);
  EXPECT_EQ(answered_.size(), 3U) << "but one at least";
  Turn(1000);
  EXPECT_EQ(answered_, (std::vector<std::uint64_t>{1, 2, 3, 4, 5}));
}

TEST_F(Wishes, OneThatNobodyReadsYetWaitsUntilItsDeadline) {
  ASSERT_TRUE(wishes_.Add(Wish(1)));
  reachable_ = false;
  EXPECT_EQ(Turn(), 0U);
  now_ += seconds(1);
  reachable_ = true;
  EXPECT_EQ(Turn(), 0U);
  EXPECT_EQ(answered_.size(), 1U);
  ASSERT_TRUE(wishes_.Add(Wish(2)));
  reachable_ = false;
  now_ += seconds(3);
  EXPECT_EQ(Turn(), 1U) << "given up";
  EXPECT_EQ(Turn(), 0U);
}

TEST_F(Wishes, AMapThatIsYetToComeIsWaitedForIfSoWished) {
  known_cells_ = 0;
  ASSERT_TRUE(wishes_.Add(Wish(1, 1, true)));
  ASSERT_TRUE(wishes_.Add(Wish(2, 1, false)));
  Turn();
  EXPECT_EQ(answered_, std::vector<std::uint64_t>{2}) << "there is no map, which is an answer as well";
  known_cells_ = 9;
  Turn();
  EXPECT_EQ(cells_.back(), 9U);
  ASSERT_TRUE(wishes_.Add(Wish(3, 2, true)));
  now_ += seconds(3);
  EXPECT_EQ(Turn(), 0U);
  EXPECT_EQ(cells_.back(), 0U) << "at its deadline it gets what there is";
}

TEST(DoorFailures, AreCountedAndTheWorkGoesOn) {
  Failures failures("a test");
  EXPECT_TRUE(failures.Guard([] {}));
  EXPECT_FALSE(failures.Guard([] { throw std::bad_alloc(); }));
  EXPECT_FALSE(failures.Guard([] { throw std::runtime_error("why"); }));
  EXPECT_EQ(failures.count(), 2U);
}

}  // namespace
}  // namespace cairn::server
