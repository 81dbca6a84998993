// Which keyframes are given up. The robot drives round and round on a circle of 16 m.
#include "server/slam/trail/retirement_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "common/geometry/angle.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kPerRound = 80;
constexpr double kAround = 2.0 * std::numbers::pi;
constexpr double kRadiusM = 16.0 / kAround;
constexpr RetireOptions kOptions{.recent_keyframes = 200, .visits = 3, .cell_m = 1.0};

struct Rounds {
  Trail trail{MotionNoise{}};
  PosePath path;
};

// Every keyframe but those of the first round has seen the same place a round before, if `tied`.
Rounds Drive(std::size_t rounds, bool tied = true) {
  Rounds drive;
  for (std::size_t k = 0; k < rounds * kPerRound; ++k) {
    const double angle = kAround * static_cast<double>(k % kPerRound) / kPerRound;
    const Pose2 pose{kRadiusM * std::cos(angle), kRadiusM * std::sin(angle), WrapAngle(angle + kAround / 4.0)};
    std::optional<RevisitObservation> revisit;
    if (tied && k >= kPerRound) revisit = RevisitObservation{k - kPerRound, {}, Eigen::Matrix3d::Identity()};
    drive.trail.Append({std::make_shared<const Scan>(), {}}, pose, {}, Eigen::Matrix3d::Zero(), revisit);
    drive.path.Append(pose);
  }
  return drive;
}

TEST(RetirementChoice, KeepsTheFirstVisitOfAPlaceAndTheLast) {
  const Rounds drive = Drive(10);
  const auto chosen = ChooseRetired(drive.trail, drive.path, drive.trail.size(), kOptions);
  ASSERT_TRUE(chosen);
  ASSERT_EQ(chosen->representative.size(), drive.trail.size());
  for (std::size_t k = 0; k < drive.trail.size(); ++k) {
    const std::size_t round = k / kPerRound;
    // A visit at the end of a round and the beginning of the next is one.
    if (round == 0 || round == 9) {
      EXPECT_TRUE(chosen->IsKept(k)) << k;
    }
    if (round >= 2 && round <= 6) {
      EXPECT_FALSE(chosen->IsKept(k)) << k;
    }
  }
  EXPECT_LT(chosen->kept.size(), 4 * kPerRound);
}

TEST(RetirementChoice, EachIsRepresentedByAKeptOneAtTheSamePlace) {
  const Rounds drive = Drive(10);
  const auto chosen = ChooseRetired(drive.trail, drive.path, drive.trail.size(), kOptions);
  ASSERT_TRUE(chosen);
  for (std::size_t k = 0; k < drive.trail.size(); ++k) {
    const std::size_t represents = chosen->representative[k];
    ASSERT_TRUE(chosen->IsKept(represents));
    EXPECT_EQ(chosen->kept[chosen->index_after[k]], represents);
    EXPECT_LT((drive.path[k].translation() - drive.path[represents].translation()).norm(), 1e-9);
    EXPECT_LT(std::abs(AngleDiff(drive.path[k].theta, drive.path[represents].theta)), 1e-9);
  }
}

// A job has added relations along the same drive, 10 m on.
TEST(RetirementChoice, RelationsAlongTheSameDriveAreNoMatches) {
  const auto add = [](Rounds& drive) {
    for (std::size_t k = 50; k < drive.trail.size(); ++k)
      drive.trail.AddLoop(
          {k - 50, k, Between(drive.path[k - 50], drive.path[k]), 1e-4 * Eigen::Matrix3d::Identity(), true});
  };
  Rounds drive = Drive(10);
  add(drive);
  const auto chosen = ChooseRetired(drive.trail, drive.path, drive.trail.size(), kOptions);
  ASSERT_TRUE(chosen);
  EXPECT_LT(chosen->kept.size(), 4 * kPerRound);
  for (std::size_t k = 0; k < drive.trail.size(); ++k)
    EXPECT_LT((drive.path[k].translation() - drive.path[chosen->representative[k]].translation()).norm(), 1e-9) << k;
  Rounds loose = Drive(10, false);
  add(loose);
  EXPECT_FALSE(ChooseRetired(loose.trail, loose.path, loose.trail.size(), kOptions));
}

// Only every tenth keyframe has a match, 2 m apart.
TEST(RetirementChoice, ARepresentativeIsNear) {
  Rounds drive;
  for (std::size_t k = 0; k < 10 * kPerRound; ++k) {
    const Pose2 pose = Drive(1).path[k % kPerRound];
    std::optional<RevisitObservation> revisit;
    if (k >= kPerRound && k % 10 == 0) revisit = RevisitObservation{k - kPerRound, {}, Eigen::Matrix3d::Identity()};
    drive.trail.Append({std::make_shared<const Scan>(), {}}, pose, {}, Eigen::Matrix3d::Zero(), revisit);
    drive.path.Append(pose);
  }
  const auto chosen = ChooseRetired(drive.trail, drive.path, drive.trail.size(), kOptions);
  ASSERT_TRUE(chosen);
  EXPECT_LT(chosen->kept.size(), 5 * kPerRound);
  for (std::size_t k = 0; k < drive.trail.size(); ++k) {
    const Pose2 T = Between(drive.path[chosen->representative[k]], drive.path[k]);
    EXPECT_LT(T.translation().norm(), 3.01) << k;
    EXPECT_LT(Between(T, chosen->T_representative_keyframe[k]).translation().norm(), 1e-6) << k;
  }
}

TEST(RetirementChoice, KeepsWhatIsRecentOrNotTiedOrNotLocalized) {
  const Rounds drive = Drive(10);
  const std::size_t end = 5 * kPerRound;
  const auto chosen = ChooseRetired(drive.trail, drive.path, end, kOptions);
  ASSERT_TRUE(chosen);
  for (std::size_t k = end; k < drive.trail.size(); ++k) EXPECT_TRUE(chosen->IsKept(k)) << k;
  EXPECT_FALSE(chosen->IsKept(end - 10));

  const Rounds loose = Drive(10, false);
  EXPECT_FALSE(ChooseRetired(loose.trail, loose.path, loose.trail.size(), kOptions));

  Rounds lost = Drive(9);
  for (std::size_t k = 0; k < 2 * kPerRound; ++k) {
    const Pose2 pose = lost.path[k];
    lost.trail.Append({std::make_shared<const Scan>(), {}}, pose, {}, Eigen::Matrix3d::Zero(),
                      RevisitObservation{k, {}, Eigen::Matrix3d::Identity()});
    if (k < kPerRound) lost.trail.MarkLast(false, false);
    lost.path.Append(pose);
  }
  const auto of_lost = ChooseRetired(lost.trail, lost.path, lost.trail.size(), kOptions);
  ASSERT_TRUE(of_lost);
  for (std::size_t k = 9 * kPerRound; k < 10 * kPerRound; ++k) EXPECT_TRUE(of_lost->IsKept(k)) << k;
}

// It is never away from any place for long.
TEST(RetirementChoice, ARobotThatShuttlesDoesNotKeepAll) {
  constexpr std::size_t kThereAndBack = 40;  // Over 4 m.
  Rounds drive;
  for (std::size_t k = 0; k < 30 * kThereAndBack; ++k) {
    const std::size_t step = k % kThereAndBack;
    const bool there = step < kThereAndBack / 2;
    const double x = 0.2 * static_cast<double>(there ? step : kThereAndBack - step);
    std::optional<RevisitObservation> revisit;
    if (k >= 2 * kThereAndBack) revisit = RevisitObservation{k - 2 * kThereAndBack, {}, Eigen::Matrix3d::Identity()};
    const Pose2 pose{x, 0.0, there ? 0.0 : kPi};
    drive.trail.Append({std::make_shared<const Scan>(), {}}, pose, {}, Eigen::Matrix3d::Zero(), revisit);
    drive.path.Append(pose);
  }
  const auto chosen = ChooseRetired(drive.trail, drive.path, drive.trail.size() - 200, kOptions);
  ASSERT_TRUE(chosen);
  EXPECT_LT(chosen->kept.size(), 200 + 8 * kThereAndBack);
}

// A laser that sees only what lies ahead sees something else on the way back.
TEST(RetirementChoice, TheWayBackIsAnotherPlace) {
  Rounds drive = Drive(3);
  for (std::size_t k = 0; k < 3 * kPerRound; ++k) {
    const Pose2& there = drive.path[3 * kPerRound - 1 - k];
    const Pose2 pose{there.x, there.y, WrapAngle(there.theta + kAround / 2.0)};
    drive.trail.Append({std::make_shared<const Scan>(), {}}, pose, {}, Eigen::Matrix3d::Zero(),
                       RevisitObservation{3 * kPerRound - 1 - k, {}, Eigen::Matrix3d::Identity()});
    drive.path.Append(pose);
  }
  EXPECT_FALSE(ChooseRetired(drive.trail, drive.path, drive.trail.size(), kOptions));
}

TEST(RetirementChoice, FewAreNotWorthTheWork) {
  const Rounds drive = Drive(10);
  EXPECT_FALSE(ChooseRetired(drive.trail, drive.path, kPerRound + 30, kOptions));
}

}  // namespace
}  // namespace cairn::slam
