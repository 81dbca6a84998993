#include "server/slam/map_drawing.h"

#include <gtest/gtest.h>

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

SharedSequence<Pose2> Path() {
  SharedSequence<Pose2> path;
  for (std::size_t k = 0; k < kKeyframes; ++k) path.Append(PlaceOf(k));
  return path;
}

std::size_t ChunksOfOne() {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(RoomScan(0), {});
  return grid.chunk_count();
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

  drawing.Adopt(OccupancyGrid(GridOptions{}), 0, keyframes, Path());
  EXPECT_EQ(drawing.grid().chunk_count(), drawn);

  MapDrawing begun{GridOptions{}};
  begun.Begin(Keyframes(kKeyframes - 1), Path());
  EXPECT_EQ(begun.grid().chunk_count(), 0U);
  EXPECT_EQ(begun.path().size(), kKeyframes);
}

}  // namespace
}  // namespace cairn::slam
