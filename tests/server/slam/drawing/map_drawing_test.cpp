#include "server/slam/drawing/map_drawing.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/server/support/room_world.h"

namespace cairn::slam {
namespace {

using server::testing::RoomScan;

// Keyframes far apart, so that the number of chunks tells which of them were drawn.
constexpr std::size_t kKeyframes = 4;

Pose2 PlaceOf(std::size_t k) {
  return {128.0 * static_cast<double>(k), 0.0, 0.0};  // A multiple of the side of a chunk.
}

std::vector<Keyframe> Keyframes(std::size_t lost) {
  std::vector<Keyframe> keyframes;
  for (std::size_t k = 0; k < kKeyframes; ++k) {
    keyframes.push_back({std::make_shared<const Scan>(RoomScan(0)), {}});
    keyframes.back().localized = k != lost;
  }
  return keyframes;
}

PosePath Path() {
  PosePath path;
  for (std::size_t k = 0; k < kKeyframes; ++k) path.Append(PlaceOf(k));
  return path;
}

std::size_t ChunksOfOne() {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(RoomScan(0), {});
  return grid.chunk_count();
}

// What is drawn again was not looked at again, and after a change of the path the looks before lay elsewhere.
TEST(MapDrawing, OnlyNewKeyframesAreLooks) {
  const std::vector<Keyframe> keyframes = Keyframes(kKeyframes);
  const PosePath path = Path();
  MapDrawing drawing{GridOptions{}};
  for (std::size_t k = 0; k < kKeyframes; ++k) drawing.Add(keyframes[k], path[k]);
  EXPECT_EQ(drawing.TakeLooks().size(), kKeyframes * ChunksOfOne());
  EXPECT_TRUE(drawing.TakeLooks().empty());
  drawing.Add(keyframes.back(), path[0]);
  drawing.StartAgain(kKeyframes);
  drawing.Finish(keyframes, path);
  EXPECT_TRUE(drawing.TakeLooks().empty());
  drawing.Adopt(OccupancyGrid(GridOptions{}), kKeyframes, 1, keyframes, path);
  EXPECT_TRUE(drawing.TakeLooks().empty());
}

// What a retired keyframe has drawn stays.
TEST(MapDrawing, KeepsWhatRetiredKeyframesHaveDrawn) {
  const std::vector<Keyframe> keyframes = Keyframes(kKeyframes);
  MapDrawing drawing{GridOptions{}};
  for (std::size_t k = 0; k < kKeyframes; ++k) drawing.Add(keyframes[k], PlaceOf(k));
  drawing.StartAgain(3);
  drawing.Finish(keyframes, Path());
  drawing.Retire(
      {.kept = {0, 3}, .representative = {0, 0, 0, 3}, .index_after = {0, 0, 0, 1}, .T_representative_keyframe = {}});
  EXPECT_EQ(drawing.path(), (std::vector<Pose2>{PlaceOf(0), PlaceOf(3)}));
  EXPECT_EQ(drawing.changed_at(), 3U);
  EXPECT_EQ(drawing.grid().chunk_count(), kKeyframes * ChunksOfOne());
}

// Whichever way a keyframe comes into the map: as the next one, as the first one, or when the map is drawn again or
// replaced. A keyframe that is not localized keeps its place in the path, which has one pose for each.
TEST(MapDrawing, DrawsNoKeyframeThatIsNotLocalized) {
  const std::size_t drawn = (kKeyframes - 1) * ChunksOfOne();
  const std::vector<Keyframe> keyframes = Keyframes(2);
  MapDrawing drawing{GridOptions{}};
  for (std::size_t k = 0; k < kKeyframes; ++k) drawing.Add(keyframes[k], PlaceOf(k));
  EXPECT_EQ(drawing.grid().chunk_count(), drawn);
  EXPECT_EQ(drawing.path().size(), kKeyframes);

  drawing.StartAgain(kKeyframes);
  drawing.Finish(keyframes, Path());
  EXPECT_EQ(drawing.grid().chunk_count(), drawn);
  EXPECT_EQ(drawing.path().size(), kKeyframes);

  drawing.Adopt(OccupancyGrid(GridOptions{}), 0, 0, keyframes, Path());
  EXPECT_EQ(drawing.grid().chunk_count(), drawn);

  MapDrawing begun{GridOptions{}};
  begun.Begin(Keyframes(kKeyframes - 1), Path());
  EXPECT_EQ(begun.grid().chunk_count(), 0U);
  EXPECT_EQ(begun.path().size(), kKeyframes);
}

// Where the path goes after a correction: the same keyframes far to the north.
Pose2 CorrectedPlaceOf(std::size_t k) {
  return PlaceOf(k) * Pose2{0.0, 1280.0, 0.0};
}

class RedrawnMap : public ::testing::Test {
 protected:
  static constexpr std::size_t kMany = 45;  // Three calls of Continue, at 20 keyframes each.

  RedrawnMap() {
    for (std::size_t k = 0; k < kMany; ++k) {
      keyframes_.push_back({std::make_shared<const Scan>(RoomScan(0)), {}});
      drawing_.Add(keyframes_.back(), PlaceOf(k));
      corrected_.Append(CorrectedPlaceOf(k));
    }
  }
  bool DrawnAt(const Pose2& place) const {
    // The wall 6 m ahead of the scan's place.
    const std::uint8_t cell = drawing_.grid().OccupancyAt(place * Eigen::Vector2d(6.0, 0.0));
    return cell != kUnknownCell && cell > 50;
  }
  // The grid of a job that has drawn the first `count` keyframes along `place_of`.
  OccupancyGrid GridOf(std::size_t count, Pose2 (*place_of)(std::size_t)) const {
    OccupancyGrid grid{GridOptions{}};
    for (std::size_t k = 0; k < count; ++k) grid.Draw(*keyframes_[k].scan, place_of(k));
    return grid;
  }

  std::vector<Keyframe> keyframes_;
  PosePath corrected_;
  MapDrawing drawing_{GridOptions{}};
};

TEST_F(RedrawnMap, TakesSeveralScansAndTheOldMapStaysUntilTheNewOneIsComplete) {
  drawing_.StartAgain(kMany);
  for (int scan = 0; scan < 2; ++scan) {
    drawing_.Continue(keyframes_, corrected_);
    EXPECT_TRUE(drawing_.redrawing());
    EXPECT_TRUE(DrawnAt(PlaceOf(0)));
    EXPECT_FALSE(DrawnAt(CorrectedPlaceOf(0)));
    EXPECT_EQ(drawing_.path()[0], PlaceOf(0));
  }
  drawing_.Continue(keyframes_, corrected_);
  EXPECT_FALSE(drawing_.redrawing());
  for (const std::size_t k : {std::size_t{0}, kMany - 1}) {
    EXPECT_FALSE(DrawnAt(PlaceOf(k)));
    EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(k)));
    EXPECT_EQ(drawing_.path()[k], CorrectedPlaceOf(k));
  }
}

TEST_F(RedrawnMap, FinishDrawsAllTheRestAtOnce) {
  drawing_.StartAgain(kMany);
  drawing_.Finish(keyframes_, corrected_);
  EXPECT_FALSE(drawing_.redrawing());
  EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(kMany - 1)));
  EXPECT_FALSE(DrawnAt(PlaceOf(kMany - 1)));
}

TEST_F(RedrawnMap, BeginDrawsTheLastKeyframeAtOnceAndTheOthersLater) {
  MapDrawing begun{GridOptions{}};
  begun.Begin(keyframes_, corrected_);
  EXPECT_EQ(begun.path().size(), kMany);
  EXPECT_EQ(begun.grid().chunk_count(), ChunksOfOne());
  const std::uint8_t cell = begun.grid().OccupancyAt(CorrectedPlaceOf(kMany - 1) * Eigen::Vector2d(6.0, 0.0));
  EXPECT_TRUE(cell != kUnknownCell && cell > 50);
  EXPECT_TRUE(begun.redrawing());
  begun.Finish(keyframes_, corrected_);
  EXPECT_EQ(begun.grid().chunk_count(), kMany * ChunksOfOne());
}

TEST_F(RedrawnMap, AnAdoptedGridGetsTheKeyframesThatTheJobDidNotHave) {
  drawing_.Adopt(GridOf(40, CorrectedPlaceOf), 40, 40, keyframes_, corrected_);
  EXPECT_FALSE(drawing_.redrawing());
  EXPECT_EQ(drawing_.grid().chunk_count(), kMany * ChunksOfOne());
  for (const std::size_t k : {std::size_t{39}, std::size_t{40}, kMany - 1}) EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(k)));
}

TEST_F(RedrawnMap, AGridFromBeforeTheLastChangeOfThePathIsDrawnAgain) {
  drawing_.StartAgain(40);  // The path changed when there were 40 keyframes.
  drawing_.Finish(keyframes_, corrected_);
  drawing_.Adopt(GridOf(40, CorrectedPlaceOf), 40, 40, keyframes_, corrected_);
  EXPECT_FALSE(drawing_.redrawing()) << "the job had all keyframes whose poses changed";
  drawing_.Adopt(GridOf(39, PlaceOf), 39, 39, keyframes_, corrected_);
  EXPECT_TRUE(drawing_.redrawing());
  EXPECT_TRUE(DrawnAt(PlaceOf(0))) << "it is adopted first, so that the job is answered";
  drawing_.Finish(keyframes_, corrected_);
  EXPECT_FALSE(DrawnAt(PlaceOf(0)));
  EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(0)));
}

TEST_F(RedrawnMap, AGridThatComesWhileTheMapIsDrawnAgainDoesNotEndThat) {
  drawing_.StartAgain(40);
  drawing_.Continue(keyframes_, corrected_);
  drawing_.Adopt(GridOf(kMany, PlaceOf), kMany, kMany, keyframes_, corrected_);
  EXPECT_TRUE(drawing_.redrawing());
  drawing_.Finish(keyframes_, corrected_);
  EXPECT_EQ(drawing_.grid().chunk_count(), kMany * ChunksOfOne());
  EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(0)));
}

// Where a site goes back to an old map, a robot may lack thousands of keyframes in it, and its scans must not wait.
TEST_F(RedrawnMap, AnAdoptedGridThatLacksManyKeyframesGetsSomeWithEachScan) {
  drawing_.Adopt(GridOf(3, CorrectedPlaceOf), 3, 3, keyframes_, corrected_);
  EXPECT_TRUE(drawing_.late());
  EXPECT_EQ(drawing_.drawn(), 3U);
  EXPECT_EQ(drawing_.grid().chunk_count(), 3 * ChunksOfOne()) << "the map is that of the version from the beginning";
  EXPECT_EQ(drawing_.path()[kMany - 1], CorrectedPlaceOf(kMany - 1));
  drawing_.Continue(keyframes_, corrected_);
  EXPECT_EQ(drawing_.grid().chunk_count(), 23 * ChunksOfOne());
  // A keyframe that comes meanwhile waits for its turn.
  keyframes_.push_back(keyframes_.back());
  corrected_.Append(CorrectedPlaceOf(kMany));
  drawing_.Add(keyframes_.back(), CorrectedPlaceOf(kMany));
  EXPECT_FALSE(DrawnAt(CorrectedPlaceOf(kMany)));
  drawing_.DrawLate(keyframes_);
  EXPECT_EQ(drawing_.drawn(), 43U);
  drawing_.DrawLate(keyframes_);
  EXPECT_FALSE(drawing_.late());
  EXPECT_EQ(drawing_.grid().chunk_count(), (kMany + 1) * ChunksOfOne());
  EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(kMany)));
  drawing_.Add(keyframes_.back(), CorrectedPlaceOf(kMany + 1));
  EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(kMany + 1))) << "all are drawn, so this one is at once";
}

// Where its poses in the old map are known, those stay, and the others are those at which it is drawn.
TEST_F(RedrawnMap, KnowsWhereTheKeyframesOfAnAdoptedGridAreDrawn) {
  std::vector<Pose2> in_grid;
  for (std::size_t k = 0; k < 3; ++k) in_grid.push_back(PlaceOf(k));
  drawing_.Adopt(GridOf(3, PlaceOf), 3, 3, keyframes_, corrected_, true, in_grid);
  drawing_.Finish(keyframes_, corrected_);
  EXPECT_EQ(drawing_.path()[2], PlaceOf(2));
  EXPECT_EQ(drawing_.path()[3], CorrectedPlaceOf(3));
  EXPECT_TRUE(DrawnAt(CorrectedPlaceOf(kMany - 1)));
}

TEST_F(RedrawnMap, ALargeLoopWhileAnAdoptedGridIsContinuedDrawsAllAgain) {
  drawing_.Adopt(GridOf(3, PlaceOf), 3, 3, keyframes_, corrected_);
  drawing_.StartAgain(kMany);
  drawing_.Continue(keyframes_, corrected_);
  EXPECT_EQ(drawing_.drawn(), 23U) << "until then the map that was taken over is continued";
  drawing_.Finish(keyframes_, corrected_);
  EXPECT_FALSE(drawing_.late());
  EXPECT_EQ(drawing_.grid().chunk_count(), kMany * ChunksOfOne());
  EXPECT_EQ(drawing_.path()[0], CorrectedPlaceOf(0));
}

}  // namespace
}  // namespace cairn::slam
