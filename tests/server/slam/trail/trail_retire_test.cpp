// What a trail hands over when it gives up keyframes. The robot drives round and round on a circle.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/geometry/angle.h"
#include "server/slam/state/archive.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kPerRound = 40;
constexpr double kAround = 2.0 * std::numbers::pi;
constexpr MotionNoise kStepNoise{0.01, 0.0, 0.0, 0.01, 0.0, 0.0};

Pose2 PoseAt(std::size_t keyframe) {
  const double angle = kAround * static_cast<double>(keyframe % kPerRound) / kPerRound;
  // A little farther outside in each round.
  const double radius_m = 3.0 + 0.01 * static_cast<double>(keyframe / kPerRound);
  return {radius_m * std::cos(angle), radius_m * std::sin(angle), WrapAngle(angle + kAround / 4.0)};
}

// Keyframes [first, end), with two scans each; those from the second round on have seen the place a round before.
void DriveOn(Trail& trail, std::size_t first, std::size_t end) {
  const auto scan = std::make_shared<Scan>();
  scan->ranges_m = {1.0F, 1.0F};
  scan->angle_step_rad = 0.1;
  scan->range_max_m = 10.0;
  for (std::size_t k = first; k < end; ++k) {
    std::optional<RevisitObservation> revisit;
    if (trail.size() >= kPerRound) {
      const std::size_t old = trail.size() - kPerRound;
      revisit = RevisitObservation{old, Between(PoseAt(trail.shapes()[old].number), PoseAt(k)),
                                   1e-4 * Eigen::Matrix3d::Identity()};
    }
    trail.Append({scan, {}}, PoseAt(k), {}, Eigen::Matrix3d::Zero(), revisit);
    trail.AddScan(2 * k, {});
    trail.AddScan(2 * k + 1, {0.1, 0.0, 0.0});
  }
}

// Gives up [first, end); those of the first round represent them. The indices are those of the keyframes' numbers
// still.
Retirement GivingUp(const Trail& trail, std::size_t first, std::size_t end) {
  Retirement retirement;
  for (std::size_t k = 0; k < trail.size(); ++k) {
    const bool kept = k < first || k >= end;
    const std::size_t represents = kept ? k : k % kPerRound;
    retirement.representative.push_back(represents);
    retirement.T_representative_keyframe.push_back(
        Between(PoseAt(trail.shapes()[represents].number), PoseAt(trail.shapes()[k].number)));
    if (kept) retirement.kept.push_back(k);
  }
  for (const std::size_t k : retirement.representative)
    retirement.index_after.push_back(k < first ? k : k - (end - first));
  return retirement;
}

double ErrorOf(const PoseRelation& relation, const Trail& trail) {
  const auto pose = [&](std::size_t k) { return PoseAt(trail.shapes()[k].number); };
  const Pose2 error = Between(Between(pose(relation.from), pose(relation.to)), relation.T_from_to);
  return error.translation().norm() + std::abs(error.theta);
}

// How many keyframes hang together with the first.
std::size_t ReachedFromTheFirst(const Trail& trail) {
  std::set<std::size_t> reached{0};
  for (std::size_t before = 0; before != reached.size();) {
    before = reached.size();
    for (const PoseRelation& one : trail.relations())
      if (reached.contains(one.from) != reached.contains(one.to)) reached.insert({one.from, one.to});
  }
  return reached.size();
}

TEST(TrailRetire, KeepsNumbersScansAndTrueRelations) {
  Trail trail(kStepNoise);
  DriveOn(trail, 0, 5 * kPerRound);
  const std::vector<PoseRelation> before = trail.relations();
  trail.Retire(GivingUp(trail, kPerRound, 4 * kPerRound));

  ASSERT_EQ(trail.size(), 2 * kPerRound);
  EXPECT_EQ(trail.made(), 5 * kPerRound);
  EXPECT_EQ(trail.shapes()[kPerRound].number, 4 * kPerRound);
  EXPECT_EQ(trail.CountBelow(3 * kPerRound), kPerRound);
  EXPECT_EQ(trail.numbers().back(), 5 * kPerRound - 1);
  ASSERT_EQ(trail.scans().size(), 10 * kPerRound);
  for (const MapperSnapshot::ScanPlace& scan : trail.scans()) {
    const Pose2 expected = PoseAt(scan.stamp / 2) * Pose2{scan.stamp % 2 == 0 ? 0.0 : 0.1, 0.0, 0.0};
    const Pose2 place = PoseAt(trail.shapes()[scan.keyframe].number) * scan.T_keyframe_robot;
    EXPECT_LT((place.translation() - expected.translation()).norm(), 1e-9);
  }
  const std::vector<PoseRelation> relations = trail.relations();
  EXPECT_LT(relations.size(), before.size());
  for (const PoseRelation& relation : relations) {
    ASSERT_LT(relation.from, trail.size());
    ASSERT_LT(relation.to, trail.size());
    EXPECT_NE(relation.from, relation.to);
    EXPECT_LT(ErrorOf(relation, trail), 1e-6);
    EXPECT_GT(relation.covariance.ldlt().vectorD().minCoeff(), 0.0);
  }
}

// The last round is bound to the first only through those between.
TEST(TrailRetire, WhatHungTogetherStillDoes) {
  Trail trail(kStepNoise);
  DriveOn(trail, 0, 5 * kPerRound);
  trail.Retire(GivingUp(trail, kPerRound, 4 * kPerRound));
  EXPECT_EQ(ReachedFromTheFirst(trail), trail.size());
  // The way from the last keyframe to the first is short through what was handed over.
  EXPECT_LT(trail.distances_m()[0], 3.0);
}

// The only relation with a side way is handed over, although both its keyframes have many loops.
TEST(TrailRetire, TheOnlyRelationIsNoRepetition) {
  Trail trail(kStepNoise);
  DriveOn(trail, 0, 2 * kPerRound);
  for (std::size_t k = 2 * kPerRound; k < 2 * kPerRound + 14; ++k)
    trail.Append({std::make_shared<const Scan>(), {}}, PoseAt(k), {}, Eigen::Matrix3d::Zero(), std::nullopt);
  for (std::size_t i = 1; i < 14; ++i) {
    for (const std::size_t k : {std::size_t{0}, 2 * kPerRound})
      trail.AddLoop({k, k + i, Between(PoseAt(k), PoseAt(k + i)), Eigen::Matrix3d::Identity(), true});
    const std::size_t last = kPerRound - 1;
    trail.AddLoop({last - i, last, Between(PoseAt(last - i), PoseAt(last)), Eigen::Matrix3d::Identity(), true});
  }
  trail.Retire(GivingUp(trail, kPerRound, 2 * kPerRound));
  ASSERT_EQ(trail.size(), kPerRound + 14);
  EXPECT_EQ(ReachedFromTheFirst(trail), trail.size());
}

// A robot that drives the same round for ever.
TEST(TrailRetire, RelationsDoNotGrowWithoutEnd) {
  Trail trail(kStepNoise);
  DriveOn(trail, 0, 4 * kPerRound);
  std::size_t after_first = 0, after_last = 0, driven = 4 * kPerRound;
  for (int time = 0; time < 200; ++time) {
    trail.Retire(GivingUp(trail, kPerRound, 3 * kPerRound));
    ASSERT_EQ(trail.size(), 2 * kPerRound);
    after_last = trail.relations().size();
    if (time == 20) after_first = after_last;
    DriveOn(trail, driven, driven + 2 * kPerRound);
    driven += 2 * kPerRound;
  }
  EXPECT_LE(after_last, after_first + after_first / 4);
}

// The state of `trail`, written and read.
void ReadAgain(const Trail& trail, Trail& read) {
  StateWriter writer;
  writer(trail);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  reader(read);
  ASSERT_TRUE(reader.ok()) << reader.failed();
}

// Nothing new is seen, so that no keyframe is given up for days.
TEST(TrailRetire, TheScansOfARobotThatStandsAreBounded) {
  Trail trail(kStepNoise);
  DriveOn(trail, 0, 10);
  const auto most = static_cast<Stamp>(Trail::kMostScans);
  const Stamp first = 100, end = first + 4 * most;
  std::size_t largest = 0;
  for (Stamp stamp = first; stamp < end; ++stamp) {
    trail.AddScan(stamp, {0.01, 0.0, 0.0});
    largest = std::max(largest, trail.scans().size());
    if (stamp != first + most) continue;
    StateWriter writer;  // The blocks of a checkpoint are shared with the next one.
    writer(trail);
  }
  EXPECT_LE(largest, 2 * Trail::kMostScans + trail.size());
  const auto& scans = trail.scans();
  ASSERT_GE(scans.size(), Trail::kMostScans + 10);
  EXPECT_TRUE(std::ranges::is_sorted(scans, std::less_equal<>(), &MapperSnapshot::ScanPlace::stamp));
  for (std::size_t k = 0; k < 10; ++k) EXPECT_EQ(scans[k].stamp, static_cast<Stamp>(2 * k)) << "that of a keyframe";
  for (Stamp back = 0; back < most; ++back)
    ASSERT_EQ(scans[scans.size() - 1 - static_cast<std::size_t>(back)].stamp, end - 1 - back);

  Trail read(kStepNoise);
  ASSERT_NO_FATAL_FAILURE(ReadAgain(trail, read));
  ASSERT_EQ(read.scans().size(), scans.size());
  for (std::size_t i = 0; i < scans.size(); ++i) ASSERT_EQ(read.scans()[i].stamp, scans[i].stamp);
}

TEST(TrailRetire, IsReadAgainAsItWas) {
  Trail trail(kStepNoise);
  DriveOn(trail, 0, 5 * kPerRound);
  trail.Retire(GivingUp(trail, kPerRound, 4 * kPerRound));
  Trail read(kStepNoise);
  ASSERT_NO_FATAL_FAILURE(ReadAgain(trail, read));
  EXPECT_EQ(read.numbers(), trail.numbers());
  DriveOn(trail, 5 * kPerRound, 6 * kPerRound);
  DriveOn(read, 5 * kPerRound, 6 * kPerRound);
  const auto expected = trail.distances_m(), distances = read.distances_m();
  EXPECT_TRUE(std::ranges::equal(distances, expected));
  EXPECT_EQ(read.made(), 6 * kPerRound);
}

}  // namespace
}  // namespace cairn::slam
