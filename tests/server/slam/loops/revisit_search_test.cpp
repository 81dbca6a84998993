#include "server/slam/loops/revisit_search.h"

#include <gtest/gtest.h>

#include <random>

#include "server/slam/parallel_for.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::RingCorridor;
using test::RingSteps;
using test::World;

// A filter that believes in one path.
class Believer final : public Filter {
 public:
  explicit Believer(Hypothesis belief) : belief_(std::move(belief)) {}
  void Predict(const StepMotion& /*step*/) override {}
  bool Observe(const RevisitObservation& /*revisit*/) override { return false; }
  void Observe(const KeyframeSight& /*sight*/, const ParallelFor& /*parallel_for*/) override {}
  void Commit() override {}
  [[nodiscard]] FilterEstimate estimate() const override { return {belief_.T_map_robot, Eigen::Matrix3d::Identity()}; }
  [[nodiscard]] FilterHealth health() const override { return {}; }
  [[nodiscard]] std::size_t hypothesis_count() const override { return 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t /*index*/) const override { return belief_; }
  [[nodiscard]] std::vector<Landmark> landmarks() const override { return {}; }
  void Save(StateWriter& /*archive*/) const override {}
  void Load(StateReader& /*archive*/) override {}

 private:
  Hypothesis belief_;
};

struct Seen {
  RevisitObservation revisit;
  Pose2 T_keyframe_robot;  // The truth.
};

// A robot that comes past its start once more, and believes that it is 0.4 m farther than it is.
std::optional<Seen> SeeAgain(const World& world) {
  constexpr double kPastTheStartM = 130.0, kTooFarM = 0.4;
  Trail trail{MotionNoise{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005}};
  std::vector<Pose2> truth;
  PosePath path;
  std::mt19937_64 rng(1);
  std::vector<SurfacePoint> points;
  for (const Pose2& step : RingSteps(kPastTheStartM, 0.4)) {
    truth.push_back(truth.empty() ? Pose2{} : truth.back() * step);
    auto scan = std::make_shared<const Scan>(
        Look(world, truth.back(), Laser{.first_rad = -kPi / 2, .range_max_m = 12.0, .sigma_m = 0.01}, &rng));
    points = SurfacePointsOf(PointsOf(*scan), *scan, {});
    trail.Append({scan, truth.back()}, truth.back(), points, Eigen::Matrix3d::Zero(), std::nullopt);
    path.Append(truth.back());
  }
  // The round was closed before: otherwise the start counts as a large loop, which is not looked for here.
  const std::size_t before = trail.size() - 20;
  trail.AddLoop({0, before, Between(truth[0], truth[before]), PoseCovariance(0.05, 0.01), true});
  PathIndex index;
  index.Follow(path);
  const Believer filter({truth.back() * Pose2{kTooFarM, 0.0, 0.0}, path});
  RevisitSearch search({}, {});
  const auto found = search.Find(points, trail, trail.TravelledTo(truth.back()), filter, index, SerialFor);
  if (!found) return std::nullopt;
  return Seen{*found, Between(truth[found->keyframe], truth.back())};
}

TEST(RevisitSearch, MeasuresWhereTheRobotIsFromWhatItHasSeenBefore) {
  const auto seen = SeeAgain(RingCorridor(true));
  ASSERT_TRUE(seen);
  const Pose2 error = Between(seen->T_keyframe_robot, seen->revisit.T_keyframe_robot);
  EXPECT_LT(error.translation().norm(), 0.05);
  EXPECT_LT(seen->revisit.covariance(0, 0), 0.02);
}

// A bare corridor does not show how far along it the robot is. The match stays where the robot believed to be, and
// counted as a measurement of that.
TEST(RevisitSearch, AlongABareCorridorTheGuessIsNoMeasurement) {
  const auto seen = SeeAgain(RingCorridor(false));
  ASSERT_TRUE(seen);
  const Pose2 error = Between(seen->T_keyframe_robot, seen->revisit.T_keyframe_robot);
  EXPECT_GT(std::abs(error.x), 0.1);
  EXPECT_GT(seen->revisit.covariance(0, 0), 1.0);
  EXPECT_LT(std::abs(error.y), 0.05);
  EXPECT_LT(seen->revisit.covariance(1, 1), 0.1);
}

}  // namespace
}  // namespace cairn::slam
