// The frame of a building: maps and the direction of their walls in it.
#include "common/map/building_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace cairn {
namespace {

constexpr double kSide_m = 0.05;

OccupancyImage Empty(int width, int height, const Pose2& T_map_origin) {
  OccupancyImage image{
      .resolution_m = kSide_m, .T_map_origin = T_map_origin, .width = width, .height = height, .cells = {}};
  image.cells.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  return image;
}

std::uint8_t& CellOf(OccupancyImage& image, const Eigen::Vector2d& p_map) {
  const Eigen::Vector2d p_cells = (p_map - image.T_map_origin.translation()) / image.resolution_m;
  return image.cells.at(static_cast<std::size_t>(std::floor(p_cells.y())) * static_cast<std::size_t>(image.width) +
                        static_cast<std::size_t>(std::floor(p_cells.x())));
}

// A room of 8 x 5 m with one wall inside, turned by this angle about the image's middle.
OccupancyImage Room(double turned_rad) {
  OccupancyImage image = Empty(300, 300, {-7.5, -7.5, 0.0});
  const Pose2 T_map_room{0.0, 0.0, turned_rad};
  const auto draw = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    for (double along = 0.0; along <= 1.0; along += 0.001)
      CellOf(image, T_map_room * Eigen::Vector2d(from + along * (to - from))) = 100;
  };
  draw({-4, -2.5}, {4, -2.5});
  draw({4, -2.5}, {4, 2.5});
  draw({4, 2.5}, {-4, 2.5});
  draw({-4, 2.5}, {-4, -2.5});
  draw({1, -2.5}, {1, 1});
  return image;
}

MapEdit Origin(const Eigen::Vector2d& at, const Eigen::Vector2d& ahead) {
  return {.id = 1, .kind = MapEditKind::kOrigin, .points_map = {at, ahead}, .width_m = 0.0, .note = "", .made = 0};
}

TEST(BuildingFrame, IsThatOfTheLastOrigin) {
  EXPECT_FALSE(BuildingFrameOf({}).has_value());
  MapEdit stairs{.id = 3,
                 .kind = MapEditKind::kKeepOut,
                 .points_map = {{0, 0}, {1, 0}, {1, 1}},
                 .width_m = 0.0,
                 .note = "",
                 .made = 0};
  const auto T_map_building = BuildingFrameOf({Origin({9, 9}, {10, 9}), Origin({1, 2}, {1, 5}), stairs});
  ASSERT_TRUE(T_map_building.has_value());
  EXPECT_EQ(T_map_building->translation(), Eigen::Vector2d(1, 2));
  EXPECT_NEAR(T_map_building->theta, std::numbers::pi / 2, 1e-12);
}

TEST(BuildingFrame, ParallelToTheMapsFrameMovesOnlyTheOrigin) {
  const OccupancyImage room = Room(0.3);
  const OccupancyImage moved = InFrame(room, {1.0, -2.0, 0.0});
  EXPECT_EQ(moved.cells, room.cells);
  EXPECT_NEAR(moved.T_map_origin.x, -8.5, 1e-12);
  EXPECT_NEAR(moved.T_map_origin.y, -5.5, 1e-12);
}

// Each occupied cell has come from one, and each one is found again within a cell.
TEST(BuildingFrame, TurnedWallsAreWhereTheyWereAndHaveNoGaps) {
  OccupancyImage room = Room(0.0);
  const Pose2 T_map_frame{0.7, -1.1, 0.4};
  OccupancyImage turned = InFrame(room, T_map_frame);
  EXPECT_EQ(turned.T_map_origin.theta, 0.0);
  int walls = 0;
  for (int i = 0; i < turned.width * turned.height; ++i) {
    if (turned.cells[static_cast<std::size_t>(i)] != 100) continue;
    ++walls;
    const Eigen::Vector2d p_frame =
        turned.T_map_origin.translation() + kSide_m * Eigen::Vector2d(i % turned.width + 0.5, i / turned.width + 0.5);
    const Eigen::Vector2d p_map = T_map_frame * p_frame;
    bool near = false;
    for (const double dx : {-kSide_m, 0.0, kSide_m})
      for (const double dy : {-kSide_m, 0.0, kSide_m}) near |= CellOf(room, p_map + Eigen::Vector2d(dx, dy)) == 100;
    EXPECT_TRUE(near) << p_map.transpose();
  }
  EXPECT_GT(walls, 500);
  for (double x = -4.0; x < 4.0; x += 0.01) {
    const Eigen::Vector2d p_frame = T_map_frame.Inverse() * Eigen::Vector2d(x, -2.475);
    EXPECT_EQ(CellOf(turned, p_frame), 100) << "a gap at x " << x;
  }
}

TEST(BuildingFrame, WallsShowTheirDirectionToAQuarterOfADegree) {
  for (const double degrees : {-40.0, -7.3, 0.0, 0.4, 12.0, 44.0}) {
    const double turned_rad = degrees * std::numbers::pi / 180.0;
    const auto direction = WallDirection(Room(turned_rad));
    ASSERT_TRUE(direction.has_value()) << direction.error().message;
    EXPECT_NEAR(*direction * 180.0 / std::numbers::pi, degrees, 0.25);
  }
}

TEST(BuildingFrame, ARoundRoomAndAnEmptyOneShowNoDirection) {
  EXPECT_EQ(WallDirection(Empty(100, 100, {})).error().code, StatusCode::kFailedPrecondition);
  OccupancyImage round = Empty(300, 300, {-7.5, -7.5, 0.0});
  for (double angle = 0.0; angle < 2 * std::numbers::pi; angle += 0.002)
    CellOf(round, 6.0 * Eigen::Vector2d(std::cos(angle), std::sin(angle))) = 100;
  EXPECT_FALSE(WallDirection(round).has_value());
}

}  // namespace
}  // namespace cairn
