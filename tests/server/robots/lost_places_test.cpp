// What a session answers about where its robot may be while its place is not known.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "server/maps/localising_tiles.h"
#include "server/maps/tile_encoding.h"
#include "server/robots/session_estimator.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using testing::kOwner;
using testing::kScans;
using testing::RequestOf;
using testing::RoomOdometry;
using testing::RoomScan;

class LostPlacesTest : public ::testing::Test {
 protected:
  LostPlacesTest() { EXPECT_TRUE(record_.AddSensors({"laser"})); }

  static EstimatorSetup LostSetup() {
    EstimatorSetup setup;
    setup.mapper.filter.particles = 20;
    return setup;
  }
  void Drive(int first, int last) { Drive(record_, estimator_, first, last); }
  static void Drive(SessionRecord& record, SessionEstimator& estimator, int first, int last) {
    for (int step = first; step < last; ++step) {
      EXPECT_TRUE(record.OdometryReceived(kOwner, RoomOdometry(step).sequence));
      estimator.Handle(testing::OdometryOf("r1", RoomOdometry(step)));
      record.ScanReceived(kScans, RoomScan(step).sequence);
      estimator.Handle(testing::ScanOf("r1", RoomScan(step)));
    }
  }
  // The robot is lost, and a job finds it where it is. Whether the session takes that.
  bool Find(const std::shared_ptr<const slam::KnownGrid>& map) {
    Drive(0, 20);
    estimator_.Handle(RelocaliseWanted{});
    Drive(20, 21);
    std::optional<bool> taken;
    estimator_.Handle(
        PlaceFound{.place = Place(record_.epoch()), .map = map, .places = {}, .done = [&taken](bool confirms) {
                     taken = confirms;
                   }});
    return taken.value_or(false);
  }
  // Near enough to where the robot is to agree with it, and not so near that both are one place.
  static PlaceSuggested Place(std::uint32_t epoch) {
    const Pose2 pose = testing::TruePose(20);
    return {RoomScan(20).stamp, {pose.x + 0.3, pose.y, pose.theta}, {false, {Tile()}, 0.05, epoch}};
  }
  static std::shared_ptr<const cairn::Tile> Tile() { return EncodeTile({0, 0, 0}, TileCells{}, 0, 1); }
  static std::shared_ptr<const slam::KnownGrid> Map() {
    const std::vector<TileSet::TilePtr> tiles{Tile()};
    return KnownGridOf(tiles, 0.05, 0, {}, 1.0);
  }
  // Another server's session, from a checkpoint of the first one and what its journal has after it.
  struct Restored {
    SessionRecord record{4, RequestOf("r1"), RobotsOptions{}};
    SessionEstimator estimator{
        LostSetup(), record, {.send = [](const OutboundValue&) { return true; }, .grid_changed = [](GridChange&&) {}}};
    explicit Restored(const CheckpointContent& content, std::vector<JournalEntry> journal) {
      std::vector<std::string> pieces;
      for (const CheckpointPiece& piece : content.pieces) pieces.push_back(piece.bytes());
      EXPECT_TRUE(estimator.Load(content.main, std::vector<std::string_view>(pieces.begin(), pieces.end())));
      for (JournalEntry& entry : journal)
        estimator.Replay(std::move(entry), [](std::uint32_t, std::uint64_t) { return true; });
      estimator.Replayed();
    }
    // The places after these steps.
    std::size_t PlacesAfter(int first, int last) {
      Drive(record, estimator, first, last);
      return record.snapshot().hypotheses.size();
    }
  };
  [[nodiscard]] std::vector<PoseHypothesis> Places() const { return record_.snapshot().hypotheses; }

  SessionRecord record_{4, RequestOf("r1"), RobotsOptions{}};
  std::vector<JournalEntry> journal_;
  SessionEstimator estimator_{LostSetup(),
                              record_,
                              {.send = [](const OutboundValue&) { return true; },
                               .grid_changed = [](GridChange&&) {},
                               .store =
                                   [this](JournalEntry entry) {
                                     journal_.push_back(std::move(entry));
                                     return true;
                                   }}};
};

// Half a second has not passed since it was summed up last.
TEST_F(LostPlacesTest, WhatWasBelievedOfARobotIsGoneWithTheFirstScanThatItIsLost) {
  Drive(0, 22);
  ASSERT_FALSE(Places().empty());
  ASSERT_LT(RoomScan(22).stamp - Places().front().stamp, 5 * testing::kScanPeriod);
  estimator_.Handle(RelocaliseWanted{});
  Drive(22, 23);
  EXPECT_FALSE(record_.snapshot().status.pose.localized);
  for (const PoseHypothesis& place : Places())
    EXPECT_EQ(place.stamp, RoomScan(22).stamp) << "its own search has found it";
}

TEST_F(LostPlacesTest, WhatAJobHasFoundIsGoneWithTheMapInWhichItWasFound) {
  Drive(0, 20);
  estimator_.Handle(RelocaliseWanted{});
  Drive(20, 21);
  std::optional<bool> taken;
  estimator_.Handle(PlaceFound{.place = std::nullopt,
                               .places = {{1, {3.0, 0.0, 0.0}, 0.6}, {1, {9.0, 0.0, 0.0}, 0.4}},
                               .done = [&taken](bool confirms) { taken = confirms; }});
  EXPECT_EQ(taken, false);
  EXPECT_EQ(Places().size(), 2U);
  estimator_.Handle(EpochChange{record_.epoch() + 1});
  EXPECT_TRUE(Places().empty());
}

// The strand made the map of up to 100 x 100 m ready for use by itself, and scans waited.
TEST_F(LostPlacesTest, TheMapAroundAPlaceIsUsedAsTheJobHasMadeIt) {
  const auto map = Map();
  ASSERT_TRUE(Find(map));
  EXPECT_GT(map.use_count(), 1);
  EXPECT_TRUE(std::holds_alternative<PlaceSuggested>(journal_.back()));
}

TEST_F(LostPlacesTest, APlaceWithoutAMapIsNotTaken) {
  EXPECT_FALSE(Find(nullptr));
}

// There was no checkpoint while a place waited to be confirmed, and more and more had to be repeated after a crash.
TEST_F(LostPlacesTest, APlaceThatWaitsIsThereAlsoBehindACheckpoint) {
  ASSERT_TRUE(Find(Map()));
  const auto save = estimator_.Save();
  ASSERT_TRUE(save);
  const CheckpointContent content = save();
  const std::size_t before = journal_.size();
  estimator_.RepeatSuggestion();
  ASSERT_EQ(journal_.size(), before + 1);
  const std::vector<JournalEntry> after(journal_.begin() + static_cast<std::ptrdiff_t>(before), journal_.end());
  Restored restored(content, after), without(content, {});
  Drive(21, 32);
  ASSERT_FALSE(record_.snapshot().status.pose.localized);
  EXPECT_EQ(restored.PlacesAfter(21, 32), Places().size());
  EXPECT_EQ(without.PlacesAfter(21, 32) + 1, Places().size());
}

TEST_F(LostPlacesTest, ASessionRepeatsAPlaceThatWaitsAfterItsCheckpoint) {
  testing::OneSession one;
  std::atomic<int> suggested{0};
  one.on_store = [&suggested](JournalEntry&& entry) {
    suggested += std::holds_alternative<PlaceSuggested>(entry) ? 1 : 0;
  };
  one.Drive(0, 20);
  ASSERT_TRUE(one.WaitSettled(20));
  ASSERT_TRUE(one.session().Relocalise(std::nullopt));
  one.Drive(20, 21);
  ASSERT_TRUE(one.WaitSettled(21));
  ASSERT_TRUE(one.session().Post(
      PlaceFound{.place = Place(one.session().record().epoch()), .map = Map(), .places = {}, .done = [](bool) {}}));
  ASSERT_TRUE(one.sent().WaitFor([&] { return suggested == 1; }));
  EXPECT_EQ(one.checkpoints, 0);
  one.position = 5;
  one.Drive(21, 22);
  EXPECT_TRUE(one.sent().WaitFor([&] { return suggested == 2; }));
  EXPECT_EQ(one.checkpoints, 1);
}

// One that has waited for a minute is not repeated for ever: the journal says that it is given up.
TEST_F(LostPlacesTest, APlaceThatHasWaitedForLongIsGivenUpAtTheNextCheckpoint) {
  ASSERT_TRUE(Find(Map()));
  // The robot stands still. After 600 scans the estimator gives the place up by itself.
  for (std::uint64_t i = 1; i <= 590; ++i) {
    Scan scan = RoomScan(20);
    Odometry odometry = RoomOdometry(20);
    scan.sequence += i;
    odometry.sequence += i;
    scan.stamp += static_cast<Stamp>(i * 105 * kNanosPerSecond / 1000);
    odometry.stamp = scan.stamp;
    EXPECT_TRUE(record_.OdometryReceived(kOwner, odometry.sequence));
    estimator_.Handle(testing::OdometryOf("r1", odometry));
    record_.ScanReceived(kScans, scan.sequence);
    estimator_.Handle(testing::ScanOf("r1", scan));
  }
  estimator_.RepeatSuggestion();
  estimator_.RepeatSuggestion();
  EXPECT_EQ(std::ranges::count_if(
                journal_, [](const JournalEntry& entry) { return std::holds_alternative<PlaceSuggested>(entry); }),
            2);
  const auto* const last = std::get_if<PlaceSuggested>(&journal_.back());
  ASSERT_NE(last, nullptr);
  EXPECT_TRUE(last->map.tiles.empty());
}

}  // namespace
}  // namespace cairn::server
