// A site whose map comes from a file of Nav2, through the whole server: robots are localised where the file says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/map/map_tiles.h"
#include "server/store/site_file.h"
#include "server/store/site_from_map.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kVisitor = 9;

// How far a point lies from the walls of a rectangle.
double DistanceToWalls(const Eigen::Vector2d& p, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  const Eigen::Vector2d nearest = p.cwiseMax(low).cwiseMin(high);
  if (nearest != p) return (nearest - p).norm();
  return std::min((p - low).minCoeff(), (high - p).minCoeff());
}

bool Contains(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const Eigen::Vector2d& p) {
  return (p.array() > low.array()).all() && (p.array() < high.array()).all();
}

// The room of RoomScan, drawn in axes that are turned against those of the map.
OccupancyImage RoomImage() {
  const Eigen::Vector2d room_low(-6, -4), room_high(6, 4), box_low(1, 1), box_high(2.5, 2);
  constexpr double kHalfWall_m = 0.035;
  OccupancyImage image{0.05, {0.0, 0.0, 0.3}, 288, 236, {}};
  const Eigen::Vector2d middle(0.5 * image.resolution_m * image.width, 0.5 * image.resolution_m * image.height);
  const Eigen::Vector2d corner = -(image.T_map_origin * middle);
  image.T_map_origin.x = corner.x();
  image.T_map_origin.y = corner.y();
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const Eigen::Vector2d p = image.T_map_origin * (Eigen::Vector2d(column + 0.5, row + 0.5) * image.resolution_m);
      const double wall_m = std::min(DistanceToWalls(p, room_low, room_high), DistanceToWalls(p, box_low, box_high));
      const bool free = Contains(room_low, room_high, p) && !Contains(box_low, box_high, p);
      const std::uint8_t beside = free ? std::uint8_t{0} : kUnknownCell;
      image.cells.push_back(wall_m < kHalfWall_m ? std::uint8_t{100} : beside);
    }
  }
  return image;
}

// The room as the saved site `room` of a server in `directory`.
void SaveRoom(const TempDirectory& directory) {
  ASSERT_TRUE(SaveMapYaml(RoomImage(), directory / "room.yaml", ".pgm", {}));
  const auto map = LoadMapYaml(directory / "room.yaml");
  ASSERT_TRUE(map) << map.error().message;
  const auto cells = ResampleToTiles(*map, 0.05);
  ASSERT_TRUE(cells) << cells.error().message;
  const auto store = *OpenStore(std::string(kInMemory));
  ASSERT_TRUE(AddSiteFromMap(*store, "lab", *cells, 0.05));
  std::filesystem::create_directories(directory / "0" / "saved");
  ASSERT_TRUE(WriteSiteFile(*store, "lab", directory / "0" / "saved" / "room.site"));
}

Status Load(WholeServer& house) {
  Request load = About(RequestKind::kSiteLoad, "");
  load.saved = "room";
  return house.Ask(load).status;
}

PoseReport LastPoseIn(const WholeServer& house, const std::string& robot) {
  std::optional<PoseReport> last;
  for (const PoseReport& pose : house.All<PoseReport>())
    if (pose.robot == robot) last = pose;
  return last.value_or(PoseReport{});
}

TEST(MapFromFile, ARobotIsLocalisedInItAtTheRightPlace) {
  const TempDirectory directory;
  ASSERT_NO_FATAL_FAILURE(SaveRoom(directory));
  StoredServer server(directory / "0");
  WholeServer& house = server.house();
  const Status loaded = Load(house);
  ASSERT_TRUE(loaded.ok()) << loaded.message;
  house.Open("r1", kDriver, "lab", TruePose(0));
  house.Open("r2", kVisitor, "lab", std::nullopt);
  for (const char* robot : {"r1", "r2"}) ASSERT_TRUE(house.Ask(About(RequestKind::kLocalise, robot)).status.ok());
  house.Drive("r1", kDriver, 0, 40);
  const PoseReport pose = LastPoseIn(house, "r1");
  EXPECT_TRUE(pose.localized) << PoseReasonName(pose.reason);
  EXPECT_LT((pose.T_map_robot.translation() - TruePose(39).translation()).norm(), 0.1);
  EXPECT_LT(std::abs(WrapAngle(pose.T_map_robot.theta - TruePose(39).theta)), 0.05);
  // Where it starts was not said: it is found, and never elsewhere.
  house.Drive("r2", kVisitor, 0, 160);
  EXPECT_TRUE(LastPoseIn(house, "r2").localized) << PoseReasonName(LastPoseIn(house, "r2").reason);
  for (const PoseReport& one : house.All<PoseReport>()) {
    if (one.robot != "r2" || !one.localized) continue;
    const Pose2 truth = TruePose(static_cast<int>(one.scan_sequence) - 1);
    EXPECT_LT((one.T_map_robot.translation() - truth.translation()).norm(), 0.3) << one.scan_sequence;
  }
}

// The map is not one of robots: one that maps there starts as a fragment where it does not say where it is.
TEST(MapFromFile, ASiteOfItGoesOnAfterARestart) {
  const TempDirectory directory;
  ASSERT_NO_FATAL_FAILURE(SaveRoom(directory));
  std::map<TileKey, TileCells> before;
  {
    StoredServer first(directory / "0");
    ASSERT_TRUE(Load(first.house()).ok());
    ASSERT_TRUE(first->WaitFor([&] { return !first->CurrentTiles().empty(); }));
    first->Stop();
    for (const auto& [key, tile] : first->CurrentTiles()) before[key] = *DecodeCells(tile.bytes, tile.encoding);
  }
  StoredServer second(directory / "0");
  second->Open("r1", kDriver, "lab", std::nullopt);
  ASSERT_TRUE(second->WaitPhase("r1", kDriver, SessionPhase::kActive));
  const Reply status = second->Ask(About(RequestKind::kStatus, "r1"));
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_TRUE(status.robots[0].session.fragment);
  second->Stop();
  std::map<TileKey, TileCells> after;
  for (const auto& [key, tile] : second->CurrentTiles()) after[key] = *DecodeCells(tile.bytes, tile.encoding);
  EXPECT_TRUE(after == before);
  EXPECT_FALSE(after.empty());
}

}  // namespace
}  // namespace cairn::server::testing
