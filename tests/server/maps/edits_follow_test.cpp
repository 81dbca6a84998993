// What people say about a map stays on the walls and around the things of which they have said it, wherever the map
// goes.
#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/store/site_contents.h"
#include "server/store/sqlite_store.h"
#include "tests/server/maps/site_sessions.h"

namespace cairn::server {
namespace {

constexpr std::uint64_t kStraight = 10;  // Keyframes.

DrawnPath PathOf(const std::vector<Pose2>& poses, std::vector<std::uint64_t> numbers) {
  return {std::make_shared<const std::vector<Pose2>>(poses),
          std::make_shared<const std::vector<std::uint64_t>>(std::move(numbers))};
}

// Keyframes 0, 1, 2, ... every metre along x, moved by `motion` from the fourth on.
DrawnPath Bent(const Pose2& motion, const std::set<std::uint64_t>& retired = {}) {
  std::vector<Pose2> poses;
  std::vector<std::uint64_t> numbers;
  for (std::uint64_t i = 0; i < kStraight; ++i) {
    if (retired.contains(i)) continue;
    const Pose2 straight{static_cast<double>(i), 0.5, 0.0};
    poses.push_back(i < 3 ? straight : motion * straight);
    numbers.push_back(i);
  }
  return PathOf(poses, std::move(numbers));
}

// What a large loop does to keyframes after the third.
constexpr Pose2 kMotion{-0.4, 0.8, 0.1};

MapEdit Wall(double x_m = 5.0) {
  return {.kind = MapEditKind::kOccupied, .points_map = {{x_m, 2.0}, {x_m + 1.0, 2.0}}, .width_m = 0.1, .note = {}};
}
MapEdit Around(MapEditKind kind) {
  MapEdit edit{.kind = kind, .points_map = {{4.0, 3.0}, {5.0, 3.0}, {5.0, 4.0}}, .note = {}};
  if (kind == MapEditKind::kOrigin) edit.points_map.pop_back();
  return edit;
}

class EditsFollow : public testing::SiteTest {
 protected:
  EditsFollow() { Draw(1, Bent({})); }

  // What is drawn is free everywhere, whatever its path.
  void Draw(SessionId session, DrawnPath drawn) { DrawIn(*site_, session, std::move(drawn)); }
  static void DrawIn(Site& site, SessionId session, DrawnPath drawn) {
    site.Change({.session = session,
                 .chunks = {{{0, 0}, UniformChunk(-300)}, {{1, 0}, UniformChunk(-300)}},
                 .drawn = std::move(drawn)});
  }
  std::uint64_t Add(const MapEdit& edit) { return AddTo(*site_, edit); }
  static std::uint64_t AddTo(Site& site, MapEdit edit) {
    std::promise<Result<std::uint64_t>> done;
    site.AddEdit(std::move(edit), [&](Result<std::uint64_t> result) { done.set_value(std::move(result)); });
    return done.get_future().get().value_or(0);
  }
  // What is shown.
  std::vector<MapEdit> Edits() {
    TakeTiles();
    return *site_->snapshot()->edits;
  }
  [[nodiscard]] static int CellAt(const Site& site, const Eigen::Vector2d& point) {
    const int x = static_cast<int>(std::floor(point.x() / 0.05)), y = static_cast<int>(std::floor(point.y() / 0.05));
    const TileKey key{0, FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)};
    const auto tile = site.snapshot()->tiles.Find(key);
    if (tile == nullptr) return -1;
    const int index = (y - key.y * kTileCells) * kTileCells + x - key.x * kTileCells;
    return (*DecodeCells(tile->bytes, tile->encoding)).at(static_cast<std::size_t>(index));
  }
  static void ExpectMoved(const MapEdit& now, const MapEdit& then, const Pose2& motion) {
    const MapEdit expected = Moved(then, motion);
    ASSERT_EQ(now.points_map.size(), expected.points_map.size());
    for (std::size_t i = 0; i < now.points_map.size(); ++i)
      EXPECT_LT((now.points_map[i] - expected.points_map[i]).norm(), 1e-9) << now.points_map[i].transpose();
  }
};

TEST_F(EditsFollow, AWallMovesWithTheKeyframesNearItWhereALoopBendsThePath) {
  const MapEdit wall = Wall();
  ASSERT_EQ(Add(wall), 1U);
  EXPECT_EQ(CellAt(*site_, {5.5, 2.0}), 100);
  Draw(1, Bent(kMotion));
  const auto edits = Edits();
  ExpectMoved(edits.at(0), wall, kMotion);
  EXPECT_EQ(edits.at(0).id, 1U);
  EXPECT_EQ(site_->snapshot()->info.edits_version, 2U) << "who knows the edits asks again";
  EXPECT_EQ(CellAt(*site_, kMotion * Eigen::Vector2d(5.5, 2.0)), 100);
  EXPECT_LT(CellAt(*site_, {5.5, 2.0}), 50) << "where it was nothing is left of it";
  Draw(1, Bent(kMotion));
  Edits();
  EXPECT_EQ(site_->snapshot()->info.edits_version, 2U) << "nothing has moved";
  Draw(1, Bent({}));
  EXPECT_EQ(Edits().at(0).points_map, wall.points_map);
}

TEST_F(EditsFollow, WhatLiesBesideKeyframesThatStayStays) {
  const MapEdit wall = Wall(0.5);
  ASSERT_EQ(Add(wall), 1U);
  Draw(1, Bent(kMotion));
  EXPECT_EQ(Edits().at(0).points_map, wall.points_map);
}

// What lies in a room moves with the robot when it was in the room, and not as when it drove past behind the wall.
TEST_F(EditsFollow, AnEditMovesWithTheKeyframesThatSeeIt) {
  auto walled = std::make_shared<slam::GridChunk>(*UniformChunk(-300));
  for (std::size_t x = 0; x < kTileCells; ++x) walled->log_odds[20 * kTileCells + x] = 300;  // At y = 1 m.
  const auto draw = [&](const Pose2& later) {
    site_->Change({.session = 1, .chunks = {{{0, 0}, walled}}, .drawn = PathOf({{3.0, 0.5, 0.0}, later}, {0, 9})});
    TakeTiles();
  };
  draw({3.0, 4.0, 0.0});
  const MapEdit box{.kind = MapEditKind::kKeepOut, .points_map = {{2.9, 1.5}, {3.1, 1.5}, {3.0, 1.7}}, .note = {}};
  ASSERT_NE(Add(box), 0U);
  draw({3.5, 4.0, 0.0});
  ExpectMoved(Edits().at(0), box, {0.5, 0.0, 0.0});
}

TEST_F(EditsFollow, KeepOutsAndTheBuildingsFrameMoveInASwitchOfTheVersionAndBackAgain) {
  for (const auto kind : {MapEditKind::kKeepOut, MapEditKind::kOrigin}) ASSERT_NE(Add(Around(kind)), 0U);
  const auto adopted = [](const DrawnPath& displaced, const DrawnPath& drawn) {
    return Adopted{.session = 1,
                   .displaced = {.chunks = {{{0, 0}, UniformChunk(-300)}},
                                 .keyframes = kStraight,
                                 .path = displaced.path,
                                 .numbers = displaced.numbers},
                   .change = {.session = 1, .chunks = {{{0, 0}, UniformChunk(-200)}}, .drawn = drawn}};
  };
  const DrawnPath straight = Bent({}), bent = Bent(kMotion);
  const RobotGrid part{{{{0, 0}, UniformChunk(-200)}}, kStraight, bent.path, bent.numbers};
  auto enabled = Enable(AddVersion({{1, part}}));
  EXPECT_EQ(Edits().at(0).points_map, Around(MapEditKind::kKeepOut).points_map) << "until all have answered";
  corrections_.at(0).second.done(adopted(straight, bent));
  ASSERT_TRUE(enabled.get());
  auto edits = Edits();
  ExpectMoved(edits.at(0), Around(MapEditKind::kKeepOut), kMotion);
  ExpectMoved(edits.at(1), Around(MapEditKind::kOrigin), kMotion);

  enabled = Enable(1);
  corrections_.at(1).second.done(adopted(bent, straight));
  ASSERT_TRUE(enabled.get());
  edits = Edits();
  EXPECT_EQ(edits.at(0).points_map, Around(MapEditKind::kKeepOut).points_map);
  EXPECT_EQ(edits.at(1).points_map, Around(MapEditKind::kOrigin).points_map);
}

TEST_F(EditsFollow, WhereItsKeyframeIsRetiredAnEditHangsOnTheNextOne) {
  const MapEdit wall = Wall();
  ASSERT_EQ(Add(wall), 1U);
  Draw(1, Bent(kMotion, {5, 6}));  // At the same time as the path is bent.
  ExpectMoved(Edits().at(0), wall, kMotion);
  Draw(1, Bent({}, {5, 6}));
  ExpectMoved(Edits().at(0), wall, {});
}

TEST_F(EditsFollow, TheFrameOfARobotThatIsTakenOutOfTheMapMovesNothing) {
  const MapEdit wall = Wall();
  ASSERT_EQ(Add(wall), 1U);
  site_->Hide(1);
  Draw(1, Bent({100.0, 0.0, 0.0}));
  EXPECT_EQ(Edits().at(0).points_map, wall.points_map);
}

// Robot 2 drives where robot 1 has drawn. What it draws elsewhere is far from the wall.
TEST_F(EditsFollow, WhenASessionIsForgottenItsEditsHangOnOthersThatHaveDrawnThere) {
  const MapEdit wall = Wall();
  ASSERT_EQ(Add(wall), 1U);
  site_->Change({.session = 2, .chunks = {{{9, 9}, UniformChunk(-300)}}, .drawn = Bent({})});
  site_->Leave(1);
  site_->Change({.session = 2, .chunks = {{{9, 9}, UniformChunk(-300)}}, .drawn = Bent(kMotion)});
  EXPECT_EQ(Edits().at(0).points_map, wall.points_map) << "only the layer of robot 1 shows the wall";
  Draw(2, Bent(kMotion));
  Edits();
  Draw(2, Bent({}));
  ExpectMoved(Edits().at(0), wall, kMotion.Inverse());
}

class EditsOfStoredSite : public EditsFollow {
 protected:
  std::shared_ptr<Site> NewSite(Journal& journal) {
    return std::make_shared<Site>("lab", 0.05, MapsOptions{}, pool_, outbound_, &journal);
  }
  static std::vector<MapEdit> EditsOf(Site& site) {
    site.Publish();
    std::promise<void> reached;
    site.Probe([&] { reached.set_value(); });
    reached.get_future().wait();
    return *site.snapshot()->edits;
  }
  // A server with a wall, which ends after its path was bent.
  StoredSite Stored() {
    Journal journal(*store_, StoreOptions{});
    journal.Start();
    const auto site = NewSite(journal);
    site->Join({.session = 1, .robot = 101, .owner = sessions_.at(1)});
    DrawIn(*site, 1, Bent({}));
    EXPECT_EQ(AddTo(*site, Wall()), 1U);
    DrawIn(*site, 1, Bent(kMotion));
    ExpectMoved(EditsOf(*site).at(0), Wall(), kMotion);
    journal.Stop();
    return ReadSite(*store_, "lab")->site;
  }

  std::unique_ptr<Store> store_ = *OpenStore(kInMemory);
};

TEST_F(EditsOfStoredSite, AfterARestartTheyLieWhereTheyWereAndMoveOn) {
  const StoredSite stored = Stored();
  EXPECT_EQ(stored.anchors.at(1).points_then, Wall().points_map);
  Journal journal(*store_, StoreOptions{});
  const auto next = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(next->Restore(stored, control));
  ExpectMoved(EditsOf(*next).at(0), Wall(), kMotion);
  DrawIn(*next, 1, Bent(kMotion));  // What the session is restored with.
  next->Join({.session = 1, .robot = 101, .owner = sessions_.at(1)});
  ExpectMoved(EditsOf(*next).at(0), Wall(), kMotion);
  EXPECT_EQ(next->snapshot()->info.edits_version, 2U);
  DrawIn(*next, 1, Bent({}));
  EXPECT_EQ(EditsOf(*next).at(0).points_map, Wall().points_map);
}

// The session of another robot is restored before that on which the edit hangs.
TEST_F(EditsOfStoredSite, WhileSessionsAreRestoredNothingHangsOnOthers) {
  const StoredSite stored = Stored();
  Journal journal(*store_, StoreOptions{});
  const auto next = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(next->Restore(stored, control));
  DrawIn(*next, 2, Bent({}));
  EditsOf(*next);
  DrawIn(*next, 1, Bent(kMotion));
  for (const SessionId id : {SessionId{1}, SessionId{2}})
    next->Join({.session = id, .robot = 100 + id, .owner = sessions_.at(id)});
  DrawIn(*next, 2, Bent(kMotion));
  ExpectMoved(EditsOf(*next).at(0), Wall(), kMotion);
  DrawIn(*next, 1, Bent({}));
  EXPECT_EQ(EditsOf(*next).at(0).points_map, Wall().points_map);
}

TEST_F(EditsOfStoredSite, OnesOfAnOlderServerAreAnchoredWhenTheSessionsAreRestored) {
  StoredSite stored = Stored();
  stored.anchors.clear();
  const MapEdit there = stored.edits.at(0);
  Journal journal(*store_, StoreOptions{});
  journal.Start();
  const auto next = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(next->Restore(stored, control));
  DrawIn(*next, 1, Bent(kMotion));
  next->Join({.session = 1, .robot = 101, .owner = sessions_.at(1)});
  EXPECT_EQ(EditsOf(*next).at(0), there);
  journal.Stop();
  const auto anchors = ReadSite(*store_, "lab")->site.anchors;
  ASSERT_TRUE(anchors.contains(1)) << "also where no robot drives";
  EXPECT_EQ(anchors.at(1).points_then, there.points_map);
  DrawIn(*next, 1, Bent({}));
  ExpectMoved(EditsOf(*next).at(0), there, kMotion.Inverse());
}

// Its layer is corrected by switches of the version, as the map of a session that exists.
TEST_F(EditsOfStoredSite, OnesOnALayerMoveWithItAlsoForTheNextServer) {
  const DrawnPath straight = Bent({}), bent = Bent(kMotion);
  {
    Journal journal(*store_, StoreOptions{});
    journal.Start();
    site_ = NewSite(journal);
    site_->Join({.session = 1, .robot = 101, .owner = sessions_.at(1)});
    Draw(1, straight);
    EXPECT_EQ(Add(Wall()), 1U);
    const std::uint32_t version =
        AddVersion({{1, {{{{0, 0}, UniformChunk(-200)}}, kStraight, bent.path, bent.numbers}}});
    EXPECT_EQ(version, 2U);
    sessions_.clear();
    site_->Leave(1);
    Edits();
    journal.Stop();
  }
  Journal journal(*store_, StoreOptions{});
  site_ = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(site_->Restore(ReadSite(*store_, "lab")->site, control));
  ASSERT_TRUE(Enable(2).get());
  ExpectMoved(Edits().at(0), Wall(), kMotion);
  ASSERT_TRUE(Enable(1).get());
  EXPECT_EQ(Edits().at(0).points_map, Wall().points_map);
}

}  // namespace
}  // namespace cairn::server
