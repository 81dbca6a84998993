#include "server/slam/tracking/front_end.h"

#include <gtest/gtest.h>

#include "server/slam/methods.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

// Along a corridor and round its first corner, every scan a keyframe; the wheels turn a little too far.
std::vector<Pose2> Track(MatcherKind matcher, bool refined, double keep_above, std::uint64_t seed) {
  FrontEndOptions options;
  options.refine_enabled = refined;
  options.keep_above = keep_above;
  FrontEnd front_end(options, MakeMatcher(matcher, {}), {});
  const test::World world = test::RingCorridor(true);
  const test::Laser laser{.range_max_m = 12.0, .sigma_m = 0.02};
  std::mt19937_64 rng(seed);
  std::vector<Pose2> track;
  Pose2 truth, odometry;
  for (const Pose2& step : test::RingSteps(45.0, 0.25)) {
    const ScanView view = Look(test::Look(world, truth, laser, &rng), options);
    track.push_back(front_end.Track(view, odometry, SerialFor).T_track_robot);
    front_end.AddKeyframe(view);
    truth = truth * step;
    odometry = odometry * step * Pose2{0.0, 0.0, 0.002};
  }
  return track;
}

Pose2 Truth() {
  const std::vector<Pose2> steps = test::RingSteps(45.0, 0.25);
  Pose2 truth;
  for (std::size_t i = 0; i + 1 < steps.size(); ++i) truth = truth * steps[i];
  return truth;
}

// Every change of the reference keyframe adds its error to the path.
TEST(FrontEnd, IcpAloneDriftsLessWhereItKeepsItsReference) {
  double kept = 0.0, changed = 0.0;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    kept += std::abs(AngleDiff(Track(MatcherKind::kIcp, false, 0.75, seed).back().theta, Truth().theta));
    changed += std::abs(AngleDiff(Track(MatcherKind::kIcp, false, 1.0, seed).back().theta, Truth().theta));
  }
  EXPECT_LT(kept, 0.7 * changed);
}

TEST(FrontEnd, OthersCompareWithTheLastKeyframe) {
  EXPECT_EQ(Track(MatcherKind::kLineLsq, false, 0.0, 1), Track(MatcherKind::kLineLsq, false, 1.0, 1));
  EXPECT_EQ(Track(MatcherKind::kIcp, true, 0.0, 1), Track(MatcherKind::kIcp, true, 1.0, 1));
}

}  // namespace
}  // namespace cairn::slam
