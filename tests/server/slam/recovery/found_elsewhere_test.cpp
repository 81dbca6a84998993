// A robot that was carried to where only others have mapped, and that a job has found in their map.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "server/slam/known_grid/known_grid.h"
#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

constexpr test::Laser kRingLaser{.beams = 181, .step_rad = Radians(1.5), .range_max_m = 12.0, .sigma_m = 0.01};
constexpr std::size_t kMappedSteps = 160, kCarriedTo = 260, kLastStep = 310;

// Once round the corridor.
struct RingDrive {
  RingDrive() {
    std::mt19937_64 rng(5);
    const test::World world = test::RingCorridor(true);
    Pose2 pose;
    for (const Pose2& step : test::RingSteps(90.0, 0.25)) {
      truth.push_back(pose);
      scans.push_back(test::Look(world, pose, kRingLaser, &rng));
      scans.back().stamp = static_cast<Stamp>(scans.size()) * kNanosPerSecond / 4;
      pose = pose * step;
    }
  }
  // As others have drawn it.
  [[nodiscard]] std::shared_ptr<const KnownGrid> Map(const MapperOptions& options) const {
    OccupancyGrid grid(options.grid);
    for (std::size_t i = 0; i < scans.size(); ++i) grid.Draw(scans[i], truth[i]);
    KnownGrid::Tiles tiles;
    grid.ForEachChunk([&](const ChunkKey& key, const GridChunk& chunk) {
      tiles.emplace(key, std::make_shared<const TileCells>(OccupanciesOf(chunk)));
    });
    return std::make_shared<const KnownGrid>(KnownGrid::Source{std::move(tiles), options.grid.resolution_m, 0},
                                             options.recovery.place, options.self_check.near_m);
  }

  std::vector<Pose2> truth;
  std::vector<Scan> scans;
};

// All particles must go on there, however the map of each of them is bent: otherwise the pose jumps as soon as another
// one is the best.
TEST(FoundElsewhere, EveryParticleGoesOnWhereTheOthersMapShowsTheRobot) {
  MapperOptions options;
  options.filter.particles = 20;
  options.filter.back_end.drift.rot_per_m = 0.01;  // The map of every particle is bent.
  const RingDrive drive;
  ScanOutcome last;
  ScanPipeline pipeline(options, {}, SerialFor,
                        {.used = [&last](const Scan&, const ScanOutcome& outcome) { last = outcome; },
                         .dropped = [](const Scan&, DropReason) {}});
  const auto feed = [&](std::size_t i) {
    pipeline.Add(Odometry{0, drive.scans[i].stamp, drive.truth[i]});
    pipeline.Add(std::make_shared<const Scan>(drive.scans[i]));
  };
  for (std::size_t i = 0; i < kMappedSteps; ++i) feed(i);
  Mapper& mapper = pipeline.mapper();
  const std::size_t mapped = mapper.keyframe_count();
  const auto farthest_m = [&](std::size_t i) {
    double farthest = 0.0;
    for (const WeightedPose& one : mapper.belief(last.T_map_robot))
      farthest = std::max(farthest, (one.T_map_robot.translation() - drive.truth[i].translation()).norm());
    return farthest;
  };
  EXPECT_GT(farthest_m(kMappedSteps - 1), 1.0) << "the maps must differ";
  mapper.Relocalise(std::nullopt);
  const auto map = drive.Map(options);
  bool told = false;
  std::size_t i = kCarriedTo;
  for (; i < kLastStep && !(told && last.localized); ++i) {
    feed(i);
    const Mapper::LostView lost = mapper.SeenWhileLost();
    if (!told && lost.since_lost) told = mapper.SuggestPlace(lost.scans.back().scan->stamp, drive.truth[i], map);
  }
  ASSERT_TRUE(told && last.localized);
  EXPECT_LT(farthest_m(i - 1), 0.8);
  EXPECT_LT((last.T_map_robot.translation() - drive.truth[i - 1].translation()).norm(), 0.2);
  // Where it was found is no place relative to what it has seen before.
  for (const PoseRelation& one : mapper.Snapshot().relations) EXPECT_TRUE(!one.loop || one.to < mapped);
}

}  // namespace
}  // namespace cairn::slam
