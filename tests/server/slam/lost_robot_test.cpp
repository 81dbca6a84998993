// A robot whose scans show nothing real: what it draws, and how much of it one session may hold.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;

constexpr Laser kLaser{.beams = 181, .step_rad = Radians(1.5), .sigma_m = 0.01};

// A robot that drives along x in a room, half a metre a step, and sees the room or ranges drawn at random.
class Robot {
 public:
  explicit Robot(const MapperOptions& options)
      : pipeline_(options, {}, SerialFor,
                  {.used =
                       [this](const Scan&, const ScanOutcome& outcome) {
                         last = outcome;
                         ++used;
                       },
                   .dropped = [this](const Scan&, DropReason reason) { full += reason == DropReason::kSessionFull; }}) {
  }

  void Drive(int steps, bool random_ranges) {
    std::uniform_real_distribution<float> range(0.5F, 20.0F);
    for (int i = 0; i < steps; ++i) {
      Scan scan = Look(room_, truth_, kLaser, &rng_);
      if (random_ranges) std::generate(scan.ranges_m.begin(), scan.ranges_m.end(), [&] { return range(rng_); });
      scan.stamp = (++stamp_) * kNanosPerSecond / 2;
      pipeline_.Add(Odometry{0, scan.stamp, truth_});
      pipeline_.Add(std::make_shared<const Scan>(std::move(scan)));
      truth_.x += forward_ ? 0.5 : -0.5;
      if (truth_.x > 20.0 || truth_.x < 0.0) forward_ = !forward_;
    }
  }
  [[nodiscard]] std::size_t chunks() const { return pipeline_.mapper().grid().chunk_count(); }
  [[nodiscard]] const Mapper& mapper() const { return pipeline_.mapper(); }

  ScanOutcome last;
  int used = 0;
  int full = 0;

 private:
  test::World room_ = test::Room(-3, -4, 24, 5);
  Pose2 truth_;
  bool forward_ = true;
  Stamp stamp_ = 0;
  std::mt19937_64 rng_{4};
  ScanPipeline pipeline_;
};

MapperOptions FewParticles() {
  MapperOptions options;
  options.filter.particles = 10;
  return options;
}

// Random ranges made a map of hundreds of megabytes in half a minute, and all of it went into the map of the site.
TEST(LostRobot, DrawsNothingUntilItIsLocalizedAgain) {
  Robot robot(FewParticles());
  robot.Drive(30, false);
  ASSERT_TRUE(robot.last.localized);
  const std::size_t chunks = robot.chunks();
  const std::size_t keyframes = robot.mapper().keyframe_count();
  robot.Drive(110, true);
  EXPECT_FALSE(robot.last.localized);
  EXPECT_EQ(robot.mapper().keyframe_count(), keyframes);
  EXPECT_EQ(robot.chunks(), chunks);
  // It sees walls again, and its path goes on when it has been found in its map.
  robot.Drive(60, false);
  EXPECT_TRUE(robot.last.localized);
  EXPECT_GT(robot.mapper().keyframe_count(), keyframes + 10);
  const std::vector<Keyframe> all = robot.mapper().Snapshot().keyframes;
  EXPECT_TRUE(std::all_of(all.begin(), all.end(), [](const Keyframe& k) { return k.localized; }));
}

TEST(LostRobot, AFullSessionRefusesScansAndCountsThem) {
  MapperOptions options = FewParticles();
  options.max_keyframes = 20;
  Robot robot(options);
  robot.Drive(100, false);
  EXPECT_EQ(robot.mapper().keyframe_count(), 20U);
  EXPECT_EQ(robot.used + robot.full, 100);
  EXPECT_GE(robot.full, 75);
}

TEST(LostRobot, ASessionIsFullWithTheLastChunkThatTheOptionsAllow) {
  const auto scan = std::make_shared<const Scan>(Look(test::Office(), {}, {}));
  Mapper unbounded({}, {}, 1);
  static_cast<void>(unbounded.Process(scan, {}, SerialFor));
  const auto chunks = static_cast<std::int64_t>(unbounded.grid().chunk_count());
  ASSERT_GT(chunks, 0);
  for (const std::int64_t more : {0, 1}) {
    MapperOptions options;
    options.max_chunks = chunks + more;
    Mapper mapper(options, {}, 1);
    EXPECT_FALSE(mapper.full());
    static_cast<void>(mapper.Process(scan, {}, SerialFor));
    EXPECT_EQ(mapper.full(), more == 0);
  }
}

TEST(LostRobot, TheMapOfOneSessionIsBounded) {
  MapperOptions options = FewParticles();
  options.lost_after_m = 1000.0;  // It believes in whatever it sees.
  options.self_check.enabled = false;
  options.max_chunks = 30;
  Robot robot(options);
  robot.Drive(200, true);
  // The scan that passed the bound was drawn to its end: its rays reach 25 m.
  EXPECT_LE(robot.chunks(), 30U + 81U);
  EXPECT_GT(robot.full, 150);
}

}  // namespace
}  // namespace cairn::slam
