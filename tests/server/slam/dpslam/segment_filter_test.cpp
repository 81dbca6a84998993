#include "server/slam/dpslam/segment_filter.h"

#include <gtest/gtest.h>

#include "tests/server/slam/dpslam/drive.h"

namespace cairn::slam {
namespace {

constexpr double kMemoryM = 12.0;

LevelOptions High(std::int64_t particles) {
  LevelOptions options;
  options.particles = particles;
  options.sigma_m = 0.07;
  options.evidence_share = 0.2;
  options.unseen_per_m = 0.3;
  options.ray_stride = 4;
  options.resample_below = 0.5;
  options.give_up_behind = 0.0;
  options.drift = {0.05, 0.0, 0.0, 0.02, 0.0, 0.0};
  return options;
}

// A ring driven beyond its start, in segments of eight scans that are a metre apart. Every segment is bent in
// the same direction.
struct Segments {
  std::vector<Pose2> truth;  // The true pose of every scan.
  std::vector<Evidence> trajectories;
};
Segments BentRing(double bend_rad, double width_m = 24.0, double laps = 1.25) {
  constexpr std::size_t kScans = 8;
  const auto drive = DriveRing(width_m, 18.0, laps, 61, 21);
  Segments segments;
  std::vector<std::shared_ptr<LaserRays>> rays;
  for (std::size_t i = 0; i < drive.size(); i += 5) {
    segments.truth.push_back(drive[i].T_map_robot);
    rays.push_back(std::make_shared<LaserRays>(RaysOf(drive[i].scan, {})));
  }
  for (std::size_t first = 0; first + kScans <= rays.size(); first += kScans) {
    const Pose2 T_joint = segments.truth[first == 0 ? 0 : first - 1].Inverse();
    Evidence trajectory;
    for (std::size_t k = 0; k < kScans; ++k)
      trajectory.push_back({rays[first + k], T_joint * segments.truth[first + k] *
                                                 Pose2{0.0, 0.0, bend_rad * static_cast<double>(k + 1) / kScans}});
    segments.trajectories.push_back(std::move(trajectory));
  }
  segments.truth.resize(kScans * segments.trajectories.size());
  return segments;
}

// The error of the path between the last scan and the first scan near it, against the truth.
double LoopErrorOf(const Segments& segments, const PosePath& path) {
  const std::size_t last = segments.truth.size() - 1;
  std::size_t near = 0;
  for (std::size_t i = 0; i < last / 2; ++i)
    if (Between(segments.truth[i], segments.truth[last]).translation().norm() <
        Between(segments.truth[near], segments.truth[last]).translation().norm())
      near = i;
  return Between(Between(segments.truth[near], segments.truth[last]), Between(path[near], path[last]))
      .translation()
      .norm();
}

// The largest distance of the path from the truth.
double WorstError(const Segments& segments, const PosePath& path) {
  double worst = 0.0;
  for (std::size_t i = 0; i < segments.truth.size(); ++i)
    worst = std::max(worst, (path[i].translation() - segments.truth[i].translation()).norm());
  return worst;
}

SegmentFilter Driven(const Segments& segments, const LevelOptions& options, std::uint64_t seed) {
  SegmentFilter filter(options, {}, kMemoryM, segments.truth.front());
  Rng rng(seed);
  for (const Evidence& trajectory : segments.trajectories) {
    filter.Take({trajectory}, 8.0, rng);
    while (filter.at_work()) filter.Work(rng, SerialFor);
  }
  return filter;
}

TEST(SegmentFilter, ClosesALoopThatNoParticleFits) {
  const Segments segments = BentRing(0.015);
  const SegmentFilter filter = Driven(segments, High(60), 1);
  Pose2 joint = segments.truth.front();
  PosePath bent;
  for (const Evidence& trajectory : segments.trajectories) {
    const Pose2 from = joint;
    for (const PlacedRays& placed : trajectory) bent.Append(joint = from * placed.T_start_robot);
  }
  ASSERT_EQ(filter.level().best().path.size(), segments.truth.size());
  EXPECT_GT(LoopErrorOf(segments, bent), 0.5);
  EXPECT_LT(LoopErrorOf(segments, filter.level().best().path), 0.2);
  EXPECT_GT(filter.MapImage().width, 0);
}

TEST(SegmentFilter, WhereNobodyComesBackNobodyDiesAndNothingIsDrawn) {
  const Segments segments = BentRing(0.0, 70.0, 0.35);  // Along one side.
  SegmentFilter filter(High(20), {}, kMemoryM, segments.truth.front());
  Rng rng(2);
  ASSERT_GT(segments.trajectories.size(), 5u);
  for (const Evidence& trajectory : segments.trajectories) {
    filter.Take({trajectory}, 8.0, rng);
    while (filter.at_work()) filter.Work(rng, SerialFor);
    EXPECT_NEAR(filter.level().effective_sample_size(), 20.0, 1e-6);
    EXPECT_TRUE(filter.level().maps().blank());
  }
  EXPECT_GT(filter.level().covariance().trace(), 1e-3);
}

// This path used to be a sample like the others, and jumped by their whole spread at the first joint.
TEST(SegmentFilter, TheBestOneDoesNotDriftWhereNothingAsksForIt) {
  const Segments segments = BentRing(0.0, 70.0, 0.35);  // Along one side.
  const SegmentFilter filter = Driven(segments, High(20), 4);
  EXPECT_LT(WorstError(segments, filter.level().best().path), 1e-9);
}

// This path used to be bent by 0.15 to 0.5 m, when all particles drew the whole drift at every joint.
TEST(SegmentFilter, ALoopThatFitsBendsNothing) {
  const Segments segments = BentRing(0.0);
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    EXPECT_LT(WorstError(segments, Driven(segments, High(60), seed).level().best().path), 0.12) << seed;
}

TEST(SegmentFilter, ChangesNothingOutsideUntilItsWorkIsDone) {
  const Segments segments = BentRing(0.0);
  SegmentFilter filter(High(20), {}, kMemoryM, segments.truth.front());
  Rng rng(3);
  int calls = 0;
  for (const Evidence& trajectory : segments.trajectories) {
    const PosePath before = filter.level().best().path;
    filter.Take({trajectory}, 8.0, rng);
    while (filter.at_work()) {
      ASSERT_EQ(filter.level().best().path.size(), before.size());
      for (std::size_t k = 0; k < before.size(); ++k) ASSERT_EQ(filter.level().best().path[k], before[k]);
      filter.Work(rng, SerialFor);
      ++calls;
    }
    EXPECT_EQ(filter.level().best().path.size(), before.size() + trajectory.size());
  }
  EXPECT_GT(calls, static_cast<int>(segments.trajectories.size()));  // Some took more than one.
}

}  // namespace
}  // namespace cairn::slam
