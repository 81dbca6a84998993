#include "server/slam/mapper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <thread>

#include "server/slam/grid/grid_image.h"
#include "tests/server/slam/ring_drive.h"

namespace cairn::slam {
namespace {

using test::Drive;
using test::DriveRound;
using test::Laser;
using test::Look;
using test::ShareMissing;

struct MapperRun {
  Trajectory online;
  MapperSnapshot snapshot;
  std::uint64_t keyframes = 0;
  double worst_m = 0.0;
};

MapperRun RunMapper(const Drive& drive, const ParallelFor& parallel_for,
                    FilterKind filter = FilterKind::kFastSlam2Points) {
  MapperOptions options;
  options.filter.kind = filter;
  options.filter.particles = 50;
  Mapper mapper(options, drive.truth.front(), 1);
  MapperRun run;
  for (std::size_t i = 0; i < drive.scans.size(); ++i) {
    const ScanOutcome outcome = mapper.Process(drive.scans[i], drive.odometry[i], parallel_for);
    const Pose2 by_odometry = outcome.T_map_odom * drive.odometry[i];
    EXPECT_LT((by_odometry.translation() - outcome.T_map_robot.translation()).norm(), 1e-9) << i;
    EXPECT_LT(std::abs(AngleDiff(by_odometry.theta, outcome.T_map_robot.theta)), 1e-9) << i;
    EXPECT_GT(outcome.score, 0.0) << i;
    EXPECT_LE(outcome.score, 1.0) << i;
    run.online.push_back({outcome.stamp, outcome.T_map_robot});
    run.keyframes += outcome.keyframe ? 1 : 0;
    run.worst_m = std::max(run.worst_m, Between(drive.truth[i], outcome.T_map_robot).translation().norm());
  }
  run.snapshot = mapper.Snapshot();
  return run;
}

TEST(Mapper, FollowsTheRobotTwiceRoundALoop) {
  const Drive drive = DriveRound();
  const MapperRun run = RunMapper(drive, SerialFor);
  const Pose2 odometry_error =
      Between(drive.truth.back(), drive.truth.front() * Between(drive.odometry.front(), drive.odometry.back()));
  EXPECT_GT(odometry_error.translation().norm(), 0.5) << "the world must need correcting";
  EXPECT_LT(run.worst_m, 0.25);
}

TEST(Mapper, PlacesSeenAgainBecomeRelationsIfTheFilterUsesThem) {
  const Drive drive = DriveRound();
  const auto revisits = [&drive](FilterKind filter) {
    const MapperSnapshot snapshot = RunMapper(drive, SerialFor, filter).snapshot;
    return std::count_if(snapshot.relations.begin(), snapshot.relations.end(),
                         [](const PoseRelation& relation) { return relation.loop; });
  };
  EXPECT_GT(revisits(FilterKind::kFastSlam2Points), 10);
  EXPECT_EQ(revisits(FilterKind::kNone), 0);
}

// FastSLAM 1.0 with a model of the odometry draws steps around what odometry reports; the match only weighs them. Here
// odometry is 20 % too long and there is nothing to weigh by.
TEST(Mapper, AModelOfTheOdometryGetsTheOdometryAndNotTheMatch) {
  MapperOptions options;
  options.filter.kind = FilterKind::kFastSlam1;
  options.filter.particles = 10;
  options.filter.sampling.model = MotionModel::kEliazar;
  options.filter.back_end.landmarks.enabled = false;
  options.revisit.enabled = options.loop.enabled = false;
  Mapper mapper(options, {}, 1);
  ScanOutcome outcome;
  for (int i = 0; i <= 20; ++i) {
    auto scan = std::make_shared<Scan>(Look(test::Office(), {0.05 * i, 0, 0}, {}));
    scan->stamp = (i + 1) * 100'000'000;
    outcome = mapper.Process(std::move(scan), {0.06 * i, 0, 0}, SerialFor);
  }
  EXPECT_NEAR(outcome.T_map_robot.x, 1.2, 0.1);
}

TEST(Mapper, SaysWhichStepsAScanTakes) {
  MapperOptions options;
  options.filter.particles = 10;
  Mapper mapper(options, {}, 1), restored(options, {}, 1);
  std::vector<ScanStep> steps;
  const auto note = [&steps](ScanStep step) { steps.push_back(step); };
  mapper.WatchSteps(note);
  restored.WatchSteps(note);
  const auto see = [&](Mapper& by, double x) {
    steps.clear();
    auto scan = std::make_shared<Scan>(Look(test::Office(), {x, 0, 0}, {}));
    scan->stamp = static_cast<Stamp>(1e9 * (1.0 + x));
    return by.Process(std::move(scan), {x, 0, 0}, SerialFor).keyframe;
  };
  using enum ScanStep;
  ASSERT_TRUE(see(mapper, 0.0));
  EXPECT_EQ(steps, (std::vector{kLook, kRecover, kOther, kFilter, kLargeLoop, kSelfCheck, kDraw, kRetire, kOther}));
  ASSERT_FALSE(see(mapper, 0.01));
  const std::vector tracked = {kLook, kMatch, kRefine, kRecover, kOther};
  EXPECT_EQ(steps, tracked);
  StateWriter writer;
  mapper.Save(writer);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  restored.Load(reader);
  ASSERT_FALSE(see(restored, 0.02));
  EXPECT_EQ(steps, tracked) << "a state that was loaded is watched as well";
  ASSERT_TRUE(see(mapper, 1.0));
  EXPECT_EQ(steps, (std::vector{kLook, kMatch, kRefine, kRecover, kOther, kFilter, kRevisit, kFilter, kFilter,
                                kLargeLoop, kSelfCheck, kDraw, kRetire, kOther}));
}

// Once round a large ring, and 28 m more. For `blind_m` metres from `blind_from_m` on, the robot sees nothing
// and its wheels slip.
Drive DriveLargeRing(double blind_from_m, double blind_m) {
  const test::World world = test::RingCorridor(true);
  const Laser laser{.beams = 181, .step_rad = Radians(1.0), .range_max_m = 12.0};
  Drive drive;
  Pose2 truth, odometry;
  double way_m = 0.0;
  for (const Pose2& step : test::RingSteps(140.0, 0.25)) {
    const bool blind = way_m > blind_from_m && way_m < blind_from_m + blind_m;
    Scan scan = Look(world, truth, laser);
    if (blind) scan.ranges_m.assign(scan.ranges_m.size(), std::numeric_limits<float>::infinity());
    scan.stamp = static_cast<Stamp>(drive.scans.size() + 1) * 100'000'000;
    drive.scans.push_back(std::make_shared<const Scan>(std::move(scan)));
    drive.odometry.push_back(odometry);
    drive.truth.push_back(truth);
    truth = truth * step;
    odometry = odometry * Pose2{(blind ? 1.6 : 1.0) * step.x, 0, step.theta};
    way_m += step.x;
  }
  return drive;
}

MapperOptions SlipOptions(bool loops) {
  MapperOptions options;
  options.filter.particles = 50;
  options.loop.enabled = loops;
  options.filter.back_end.landmarks.enabled = false;  // The landmarks alone would nearly correct the drift.
  return options;
}

// What follows from the loop reaches the pose, the path and, some scans later, the map.
TEST(Mapper, ClosesALargeLoopAndDrawsTheMapAgain) {
  const Drive drive = DriveLargeRing(44.0, 3.0);
  const auto run = [&](bool loops) {
    Mapper mapper(SlipOptions(loops), {}, 1);
    ScanOutcome outcome;
    for (std::size_t i = 0; i < drive.scans.size(); ++i)
      outcome = mapper.Process(drive.scans[i], drive.odometry[i], SerialFor);
    const double error_m = (outcome.T_map_robot.translation() - drive.truth.back().translation()).norm();
    return std::pair{error_m, mapper.grid().OccupancyAt({20.0, 0.0})};
  };
  const auto [without, unused] = run(false);
  const auto [with, middle_of_first_side] = run(true);
  EXPECT_GT(without, 0.5) << "the drift must need correcting";
  EXPECT_LT(with, 0.3);
  EXPECT_LT(middle_of_first_side, 50);
}

TEST(Mapper, ALargeLoopStaysARelation) {
  const Drive drive = DriveLargeRing(70.0, 3.0);
  MapperOptions options = SlipOptions(true);
  options.revisit.enabled = false;  // So that no other relation is a loop.
  Mapper mapper(options, {}, 1);
  for (std::size_t i = 0; i < drive.scans.size(); ++i)
    static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  const MapperSnapshot snapshot = mapper.Snapshot();
  EXPECT_TRUE(std::any_of(snapshot.relations.begin(), snapshot.relations.end(),
                          [](const PoseRelation& relation) { return relation.loop; }));
  // And whoever keeps past poses sees that the path has changed, and where it lies now.
  EXPECT_GT(mapper.path_changed_at(), 1U);
  const Trajectory along = mapper.PathByStamps();
  ASSERT_EQ(along.size(), snapshot.full_path.size());
  for (std::size_t k = 0; k < along.size(); ++k) {
    EXPECT_EQ(along[k].stamp, snapshot.keyframes[k].scan->stamp);
    EXPECT_EQ(along[k].T_map_robot, snapshot.full_path[k]);
  }
}

// The share of the seen cells of `a` that are by more than 10 % fuller or emptier in `b`.
double ShareOfCellsThatDiffer(const OccupancyGrid& a, const OccupancyGrid& b) {
  const double cell_m = a.options().resolution_m;
  int seen = 0, different = 0;
  for (double x = -5.0; x < 45.0; x += cell_m) {
    for (double y = -5.0; y < 25.0; y += cell_m) {
      const int in_a = a.OccupancyAt({x, y}), in_b = b.OccupancyAt({x, y});
      if (in_a == kUnknownCell) continue;
      ++seen;
      different += std::abs(in_a - in_b) > 10 ? 1 : 0;
    }
  }
  return static_cast<double>(different) / seen;
}

// A smoothing job takes its snapshot, then the robot closes a large loop, and then the job's grid arrives,
// drawn along the old path. The grid is adopted (so that the job is answered) and then drawn again along the
// present path.
TEST(Mapper, AGridFromBeforeALargeLoopIsDrawnAnew) {
  const Drive drive = DriveLargeRing(70.0, 3.0);
  Mapper mapper(SlipOptions(true), {}, 1);
  const auto process = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i)
      static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  };
  const auto published = [&] { return OccupancyGrid(mapper.grid().options(), mapper.ShareGrid()); };
  const std::size_t end = drive.scans.size(), snapshot_at = end * 78 / 100, adopted_at = end - 60;
  process(0, snapshot_at);
  OccupancyGrid before = published();
  const std::size_t keyframes = mapper.keyframe_count();
  process(snapshot_at, adopted_at);
  const OccupancyGrid after = published();
  EXPECT_GT(ShareMissing(before, after), 0.05) << "the loop must have moved walls";

  mapper.AdoptGrid(OccupancyGrid(before.options(), before.Share()), keyframes);
  EXPECT_GT(ShareMissing(mapper.grid(), after), 0.03) << "the old walls are there at first";
  process(adopted_at, end);
  EXPECT_LT(ShareMissing(mapper.grid(), after), 0.01);
  EXPECT_LT(ShareMissing(after, mapper.grid()), 0.01);
}

// Half a round after the grid was handed out for smoothing, it comes back: what was mapped meanwhile is drawn into it.
TEST(Mapper, AGridThatComesBackGetsWhatWasMappedMeanwhile) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1);
  const auto process = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i)
      static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  };
  process(0, 60);
  OccupancyGrid before(mapper.grid().options(), mapper.ShareGrid());
  const std::size_t keyframes = mapper.keyframe_count();
  process(60, 160);
  const OccupancyGrid after(mapper.grid().options(), mapper.ShareGrid());
  ASSERT_GT(ShareMissing(after, before), 0.1);
  mapper.AdoptGrid(std::move(before), keyframes);
  while (mapper.DrawLate()) {
  }
  EXPECT_LT(ShareMissing(after, mapper.grid()), 0.01);
  // What the grid had is not drawn twice.
  EXPECT_LT(ShareOfCellsThatDiffer(mapper.grid(), after), 0.08);
}

// The slip is where it leaves the track with the error that the tests need; elsewhere the niches correct it.
// No filter corrects the slip on a short side, so the first side is drawn a second time beside itself. The
// pose reports this with self_check on, from the second round on and not before. If the loop is closed, the
// robot is localized again.
TEST(Mapper, SaysSoWhereItDrawsTheMapBesideItself) {
  const Drive drive = DriveLargeRing(44.0, 1.2), slips_more = DriveLargeRing(44.0, 1.5);
  const auto drawn = [](const MapperSnapshot& snapshot) {
    return std::count_if(snapshot.keyframes.begin(), snapshot.keyframes.end(),
                         [](const Keyframe& keyframe) { return keyframe.localized; });
  };
  MapperSnapshot snapshot;
  const auto run = [&](const Drive& driven, FilterKind filter, bool self_check, double max_conflict = 0.4) {
    MapperOptions options;
    options.filter.kind = filter;
    options.filter.particles = 50;
    options.self_check.enabled = self_check;
    options.self_check.max_conflict = max_conflict;
    options.filter.fastslam.drawn_share = 1.0;  // With less it closes the loop before it can draw anything beside it.
    Mapper mapper(options, {}, 1);
    std::vector<ScanOutcome> outcomes;
    for (std::size_t i = 0; i < driven.scans.size(); ++i)
      outcomes.push_back(mapper.Process(driven.scans[i], driven.odometry[i], SerialFor));
    snapshot = mapper.Snapshot();
    return outcomes;
  };
  const auto error_m = [&](const ScanOutcome& outcome) {
    return (outcome.T_map_robot.translation() - drive.truth.back().translation()).norm();
  };
  const auto silent = run(drive, FilterKind::kNone, false);
  EXPECT_EQ(drawn(snapshot), std::ssize(snapshot.keyframes));
  const auto told = run(drive, FilterKind::kNone, true);
  EXPECT_LT(drawn(snapshot), std::ssize(snapshot.keyframes) - 10);  // It stops drawing beside itself ...
  const auto closed = run(slips_more, FilterKind::kFastSlam2Points, true, 0.1);
  EXPECT_EQ(drawn(snapshot), std::ssize(snapshot.keyframes));  // ... and what it left out is drawn once that is right.
  EXPECT_TRUE(std::any_of(closed.begin(), closed.end(), [](const ScanOutcome& o) { return !o.localized; }));
  ASSERT_GT(error_m(told.back()), 0.4) << "the slip must need correcting";
  EXPECT_TRUE(silent.back().localized);
  EXPECT_FALSE(told.back().localized);
  EXPECT_EQ(told.back().reason, PoseReason::kDiverged);
  const std::size_t back_at_start = 416 + 15;  // Steps of 0.25 m and five turns a corner: 8 m before the start.
  for (std::size_t i = 0; i < drive.scans.size(); ++i) {
    EXPECT_EQ(told[i].T_map_robot, silent[i].T_map_robot);  // The self check must not change the pose.
    if (i < back_at_start) {
      EXPECT_TRUE(told[i].localized) << i;
    }
  }
  EXPECT_LT(error_m(closed.back()), 0.3);
  EXPECT_TRUE(closed.back().localized);
}

// A loop corrects the path of a robot that has noticed a contradiction. From this scan on it is localized again, and
// the map that is drawn again has also the keyframes that were left out before.
TEST(Mapper, AfterALargeLoopTheRobotIsLocalizedAtOnceAndTheWholeMapIsDrawn) {
  const Drive drive = DriveLargeRing(44.0, 1.8);
  MapperOptions options;
  options.filter.particles = 50;
  options.self_check.max_conflict = 0.1;
  options.revisit.enabled = false;  // So that every loop among the relations is a large one.
  Mapper mapper(options, {}, 1);
  const auto loops = [&mapper] { return mapper.Snapshot().relations.size(); };  // There are none without a loop.
  bool was_lost = false, found = false;
  for (std::size_t i = 0; i < drive.scans.size(); ++i) {
    const ScanOutcome outcome = mapper.Process(drive.scans[i], drive.odometry[i], SerialFor);
    was_lost = was_lost || !outcome.localized;
    if (!was_lost || found || !outcome.keyframe || loops() == 0) continue;
    found = true;
    EXPECT_TRUE(outcome.localized) << i;
  }
  ASSERT_TRUE(found);
  mapper.FinishMap();
  const MapperSnapshot snapshot = mapper.Snapshot();
  OccupancyGrid whole{GridOptions{}};
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k)
    whole.Draw(*snapshot.keyframes[k].scan, snapshot.online_path[k]);
  EXPECT_EQ(ImageOf(mapper.grid()).cells, ImageOf(whole).cells);
}

TEST(Mapper, TheFullPathHasAPoseForEveryScan) {
  const Drive drive = DriveRound();
  const MapperRun run = RunMapper(drive, SerialFor);
  const Trajectory full = run.snapshot.FullTrajectory();
  ASSERT_EQ(full.size(), drive.scans.size());
  EXPECT_EQ(run.snapshot.keyframes.size(), run.keyframes);
  for (std::size_t i = 0; i < full.size(); ++i)
    ASSERT_LT(Between(drive.truth[i], full[i].T_map_robot).translation().norm(), 0.3);
}

TEST(Mapper, SameInputSameOutputWhateverTheThreads) {
  const Drive drive = DriveRound();
  const ParallelFor two_threads = [](int count, const std::function<void(int, int)>& body) {
    std::thread other([&] { body(count / 2, count); });
    body(0, count / 2);
    other.join();
  };
  const MapperRun serial = RunMapper(drive, SerialFor), parallel = RunMapper(drive, two_threads);
  ASSERT_EQ(serial.online.size(), parallel.online.size());
  for (std::size_t i = 0; i < serial.online.size(); ++i)
    ASSERT_EQ(serial.online[i].T_map_robot, parallel.online[i].T_map_robot);
}

}  // namespace
}  // namespace cairn::slam
