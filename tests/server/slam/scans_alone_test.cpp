// Robots whose odometry says nothing: there is none, it begins later, or it stands still although the robot moves.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/geometry/pose_difference.h"
#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/simulated_drive.h"

namespace cairn::slam {
namespace {

struct Followed {
  std::vector<ScanOutcome> outcomes;
  std::vector<LearnedValue> learned;
  std::size_t dropped = 0;
  std::string state;  // At the end.

  [[nodiscard]] std::size_t Alone() const {
    return static_cast<std::size_t>(std::ranges::count(outcomes, true, &ScanOutcome::scans_alone));
  }
  [[nodiscard]] std::size_t NotLocalized() const {
    return static_cast<std::size_t>(std::ranges::count(outcomes, false, &ScanOutcome::localized));
  }
};

// With `stop_every` > 0 the estimator is saved after so many scans each time, and another one goes on.
Followed Follow(const test::Drive& drive, const MapperOptions& options = {}, std::size_t stop_every = 0) {
  Followed followed;
  const ScanPipeline::Sink sink{
      .used = [&](const Scan&, const ScanOutcome& outcome) { followed.outcomes.push_back(outcome); },
      .dropped = [&](const Scan&, DropReason) { ++followed.dropped; }};
  auto pipeline = std::make_unique<ScanPipeline>(options, drive.T_map_robot_start, SerialFor, sink);
  std::size_t scans = 0;
  for (const LogRecord& record : drive.records) {
    if (const auto* const odometry = std::get_if<Odometry>(&record)) {
      pipeline->Add(*odometry);
      continue;
    }
    pipeline->Add(std::make_shared<const Scan>(std::get<Scan>(record)));
    if (stop_every == 0 || ++scans % stop_every != 0) continue;
    std::string bytes;
    pipeline->Save(bytes);
    pipeline = std::make_unique<ScanPipeline>(options, Pose2{}, SerialFor, sink);
    EXPECT_TRUE(pipeline->Load(bytes));
  }
  pipeline->Finish();
  followed.learned = pipeline->mapper().learned();
  pipeline->Save(followed.state);
  return followed;
}

bool Says(const Followed& followed, std::string_view name) {
  return std::ranges::any_of(followed.learned, [&](const LearnedValue& one) { return one.name == name; });
}

// The farthest that two estimates of one drive are apart.
double FarthestApart(const Followed& a, const Followed& b) {
  double farthest_m = 0.0;
  for (const ScanOutcome& one : a.outcomes) {
    const auto other = std::ranges::find(b.outcomes, one.stamp, &ScanOutcome::stamp);
    if (other == b.outcomes.end()) continue;
    farthest_m = std::max(farthest_m, (one.T_map_robot.translation() - other->T_map_robot.translation()).norm());
  }
  return farthest_m;
}

class ScansAlone : public testing::Test {
 protected:
  const test::Drive drive = test::SimulatedDrive(60.0);
  const Followed with_odometry = Follow(drive);
};

TEST_F(ScansAlone, ARobotWithoutOdometryIsMappedWithoutAnyOption) {
  const Followed followed = Follow(test::WithOdometry(drive, "none"));
  EXPECT_GE(followed.outcomes.size(), with_odometry.outcomes.size());
  EXPECT_EQ(followed.dropped, 0u);
  EXPECT_EQ(followed.Alone(), followed.outcomes.size());
  EXPECT_EQ(followed.NotLocalized(), 0u);
  EXPECT_LT(FarthestApart(followed, with_odometry), 0.3);
  EXPECT_TRUE(Says(followed, kLearnedNoOdometry));
  EXPECT_FALSE(Says(with_odometry, kLearnedNoOdometry));
  EXPECT_EQ(with_odometry.Alone(), 0u);
}

TEST_F(ScansAlone, OdometryThatBeginsLaterIsUsed) {
  const Followed followed = Follow(test::WithOdometry(drive, "late"));
  EXPECT_GT(followed.Alone(), followed.outcomes.size() / 4);
  EXPECT_LT(followed.Alone(), followed.outcomes.size() / 2);
  EXPECT_FALSE(followed.outcomes.back().scans_alone);
  EXPECT_LE(followed.dropped, 1u);  // It came before the odometry around it.
  EXPECT_EQ(followed.NotLocalized(), 0u);
  EXPECT_LT(FarthestApart(followed, with_odometry), 0.3);
  EXPECT_FALSE(Says(followed, kLearnedNoOdometry));
}

TEST_F(ScansAlone, OdometryThatStandsWhileTheScansMoveIsNotUsed) {
  const Followed stands = Follow(test::WithOdometry(drive, "stands"));
  EXPECT_GT(stands.Alone(), stands.outcomes.size() / 3);
  EXPECT_TRUE(stands.outcomes.back().scans_alone);
  EXPECT_LT(FarthestApart(stands, with_odometry), 0.5);
  EXPECT_TRUE(Says(stands, kLearnedOdometryStands));

  const Followed returns = Follow(test::WithOdometry(drive, "returns"));
  EXPECT_GT(returns.Alone(), returns.outcomes.size() / 6);
  EXPECT_FALSE(returns.outcomes.back().scans_alone);
  EXPECT_EQ(returns.NotLocalized(), 0u);
  EXPECT_LT(FarthestApart(returns, with_odometry), 0.5);
  EXPECT_FALSE(Says(returns, kLearnedOdometryStands));
}

// Whether odometry is used follows from what a checkpoint has.
TEST_F(ScansAlone, StoppingChangesNothing) {
  MapperOptions options;
  options.filter.particles = 30;
  for (const char* const kind : {"none", "late", "stands", "returns"}) {
    const test::Drive other = test::WithOdometry(drive, kind);
    const Followed whole = Follow(other, options), stopped = Follow(other, options, 7);
    ASSERT_EQ(whole.outcomes.size(), stopped.outcomes.size()) << kind;
    for (std::size_t i = 0; i < whole.outcomes.size(); ++i)
      ASSERT_EQ(whole.outcomes[i].T_map_robot, stopped.outcomes[i].T_map_robot) << kind << ", scan " << i;
    EXPECT_TRUE(whole.state == stopped.state) << kind;
  }
}

// The four options that map without odometry say the same as what is found out.
TEST_F(ScansAlone, WhatIsFoundOutIsWhatTheOptionsSay) {
  MapperOptions chosen;
  chosen.matcher = MatcherKind::kNdt;
  chosen.front_end.use_odometry = false;
  chosen.revisit.max_distance_m = 6.0;
  chosen.revisit.neighbours = 20;
  const test::Drive none = test::WithOdometry(drive, "none");
  const Followed found = Follow(none), said = Follow(none, chosen);
  ASSERT_EQ(found.outcomes.size(), said.outcomes.size());
  for (std::size_t i = 0; i < found.outcomes.size(); ++i)
    ASSERT_EQ(found.outcomes[i].T_map_robot, said.outcomes[i].T_map_robot) << i;
  EXPECT_EQ(said.Alone(), 0u);  // It was said, not found out.
}

}  // namespace
}  // namespace cairn::slam
