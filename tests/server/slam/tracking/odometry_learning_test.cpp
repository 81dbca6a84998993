#include "server/slam/tracking/odometry_learning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

constexpr double kTickS = 0.01;
constexpr int kTicksPerScan = 10;

// A robot that drives straight and through bends of both sides, at 0.5 m/s, and stops now and then.
Pose2 TrueStep(int tick) {
  const double t = kTickS * tick;
  const double speed = std::fmod(t, 20.0) < 1.5 ? 0.0 : 0.5;
  const double turning = std::fmod(t, 7.0) < 2.0 ? (std::fmod(t, 21.0) < 12.0 ? 0.8 : -0.8) : 0.0;
  return {speed * kTickS, 0.0, turning * kTickS};
}

struct LearningDrive {
  WheelCorrection wheels;  // The true step for a step that odometry reports.
  double lag_s = 0.0;
  int ticks = 30000;  // Five minutes, some 140 m.
  std::function<Pose2(int tick)> step = TrueStep;
  double slip_m = 0.0;     // The wheels spin this far every ten seconds.
  double noise_m = 0.003;  // Of matches.
  bool dense = true;       // There is odometry between the scans.
  Eigen::Matrix2d information = 3e4 * Eigen::Matrix2d::Identity();
  LearningOptions options{};
};

// What a perfect front-end finds along the drive, but for noise.
class Driven {
 public:
  explicit Driven(const LearningDrive& drive) : drive_(drive), learning_(drive.options, true) {
    Pose2 truth, reported;
    for (int tick = 0; tick < drive.ticks; ++tick) {
      truth_.push_back(truth);
      reported_.push_back(reported);
      const Pose2 step = drive.step(tick);
      truth = truth * step;
      const double way = step.x / drive.wheels.wheel_scale;
      const double turn = (step.theta - drive.wheels.turn_per_m * way) / drive.wheels.turn_scale;
      reported = reported * Pose2{way + (tick % 1000 == 700 ? drive.slip_m : 0.0), 0.0, turn};
    }
  }

  void Go(int from_tick, int to_tick) {
    for (int tick = from_tick; tick < to_tick; tick += kTicksPerScan) Scan(tick);
  }
  OdometryLearning& learning() { return learning_; }
  [[nodiscard]] const Pose2& last() const { return last_; }
  [[nodiscard]] double shortest_m() const { return shortest_m_; }
  [[nodiscard]] bool as_reported() const { return as_reported_; }
  LearnedValue value(OdometryLearning::Parameter parameter) { return learning_.values()[parameter]; }

 private:
  void Scan(int tick) {
    const int at = tick + static_cast<int>(std::lround((drive_.lag_s - learning_.lag_s()) / kTickS));
    if (at < 5 || at + 5 >= drive_.ticks) return;
    const auto before = static_cast<std::size_t>(at - 5), now = static_cast<std::size_t>(at),
               after = static_cast<std::size_t>(at + 5);
    const Pose2 moved = Between(reported_[before], reported_[after]);
    const Pose2 rate{moved.x / (10 * kTickS), moved.y / (10 * kTickS), moved.theta / (10 * kTickS)};
    const Pose2 before_this = last_;
    last_ = learning_.Corrected(reported_[now], true, drive_.dense ? rate : Pose2{});
    if (scans_++ > 0) shortest_m_ = std::min(shortest_m_, Between(before_this, last_).translation().norm());
    as_reported_ = as_reported_ && last_ == reported_[now];
    const Pose2& truth = truth_[static_cast<std::size_t>(tick)];
    TrackStep step;
    step.matched = true;
    step.T_track_robot = {truth.x + drive_.noise_m * normal_(random_), truth.y + drive_.noise_m * normal_(random_),
                          WrapAngle(truth.theta + 0.001 * normal_(random_))};
    step.surface_information = drive_.information;
    learning_.Learn(step);
  }

  LearningDrive drive_;
  OdometryLearning learning_;
  std::vector<Pose2> truth_, reported_;
  Pose2 last_;
  bool as_reported_ = true;
  int scans_ = 0;
  double shortest_m_ = 1.0;  // Step from scan to scan.
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
};

TEST(OdometryLearning, RecoversWhatWasInjected) {
  LearningDrive drive;
  drive.wheels = {1.03, 0.98, 0.02};
  drive.lag_s = 0.15;
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  const double truth[] = {1.03, 0.98, 0.02, 0.15};
  const double bounds[] = {0.003, 0.005, 0.003, 0.01};
  const std::vector<LearnedValue> values = driven.learning().values();
  ASSERT_EQ(values.size(), OdometryLearning::kCount);
  for (std::size_t k = 0; k < values.size(); ++k) {
    EXPECT_NEAR(values[k].value, truth[k], bounds[k]) << values[k].name;
    EXPECT_NEAR(values[k].value, truth[k], 4.0 * values[k].sigma) << values[k].name;
    EXPECT_TRUE(values[k].applied) << values[k].name;
  }
  EXPECT_NEAR(driven.learning().lag_s(), 0.15, 0.015);

  // And it is used: the next metre is as long as it is.
  const Pose2 start = driven.learning().Corrected(Pose2{}, false, {});
  const Pose2 metre = driven.learning().Corrected(Pose2{1.0 / 1.03, 0.0, 0.0}, true, {});
  EXPECT_NEAR(Between(start, metre).translation().norm(), 1.0, 0.003);
}

// From then on odometry is taken from an earlier time, but the robot has not driven back.
TEST(OdometryLearning, ALagThatIsUsedIsNoStep) {
  LearningDrive drive;
  drive.lag_s = 0.15;
  drive.step = [](int tick) { return Pose2{0.5 * kTickS, 0.0, TrueStep(tick).theta}; };
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_NEAR(driven.learning().lag_s(), 0.15, 0.015);
  EXPECT_GT(driven.shortest_m(), 0.04);  // A step takes 0.1 s, and is 0.05 m.
}

TEST(OdometryLearning, GoodOdometryIsUsedAsItCame) {
  const LearningDrive drive;
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  for (const LearnedValue& value : driven.learning().values()) EXPECT_FALSE(value.applied) << value.name;
  EXPECT_TRUE(driven.as_reported());
  EXPECT_FALSE(driven.learning().corrects());
}

// Along a corridor the match is what odometry says, and may be anything.
TEST(OdometryLearning, ADirectionThatScansLeaveOpenTeachesNothing) {
  LearningDrive drive;
  drive.wheels.wheel_scale = 1.05;
  drive.step = [](int) { return Pose2{0.5 * kTickS, 0.0, 0.0}; };
  drive.information = Eigen::Vector2d(0.0, 3e4).asDiagonal();
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_NEAR(driven.value(OdometryLearning::kWheelScale).value, 1.0, 2e-3);
  EXPECT_GT(driven.value(OdometryLearning::kWheelScale).sigma, 0.029);
  EXPECT_FALSE(driven.value(OdometryLearning::kWheelScale).applied);
}

TEST(OdometryLearning, IsBounded) {
  LearningDrive drive;
  drive.wheels.wheel_scale = 1.25;
  drive.options.largest_scale_error = 0.06;
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_DOUBLE_EQ(driven.value(OdometryLearning::kWheelScale).value, 1.06);
  const Pose2 start = driven.learning().Corrected(Pose2{}, false, {});
  const Pose2 metre = driven.learning().Corrected(Pose2{1.0, 0.0, 0.0}, true, {});
  EXPECT_NEAR(Between(start, metre).translation().norm(), 1.06, 1e-9);
}

TEST(OdometryLearning, WheelsThatSpinNowAndThenCountLittle) {
  LearningDrive drive;
  drive.slip_m = 0.4;  // Of 4.6 m: 8 % in all.
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_NEAR(driven.value(OdometryLearning::kWheelScale).value, 1.0, 0.01);
}

// A lag looks like a turn scale that changes.
TEST(OdometryLearning, NothingIsUsedWhereTheLagIsNotKnown) {
  LearningDrive drive;
  drive.wheels.wheel_scale = 1.03;
  drive.dense = false;
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_NEAR(driven.value(OdometryLearning::kWheelScale).value, 1.03, 0.003);
  EXPECT_FALSE(driven.value(OdometryLearning::kWheelScale).applied);
  EXPECT_TRUE(driven.as_reported());
}

// Something else is wrong with this odometry, and the parameters would stand for it.
TEST(OdometryLearning, WhatExplainsLittleIsNotUsed) {
  LearningDrive drive;
  drive.wheels.wheel_scale = 1.05;
  drive.noise_m = 0.03;
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_NEAR(driven.value(OdometryLearning::kWheelScale).value, 1.05, 0.02);
  EXPECT_FALSE(driven.value(OdometryLearning::kWheelScale).applied);
  EXPECT_TRUE(driven.as_reported());
}

TEST(OdometryLearning, CanBeSwitchedOff) {
  LearningDrive drive;
  drive.wheels.wheel_scale = 1.05;
  drive.options.enabled = false;
  Driven driven(drive);
  driven.Go(0, drive.ticks);
  EXPECT_TRUE(driven.learning().values().empty());
  EXPECT_TRUE(driven.as_reported());
  OdometryLearning without_odometry({}, false);
  EXPECT_EQ(without_odometry.Corrected({1.0, 2.0, 3.0}, true, {}), (Pose2{1.0, 2.0, 3.0}));
  EXPECT_TRUE(without_odometry.values().empty());
}

std::string BytesOf(OdometryLearning& learning) {
  StateWriter writer;
  writer(learning);
  return writer.Bytes();
}

TEST(OdometryLearning, GoesOnAsBeforeFromItsState) {
  LearningDrive drive;
  drive.wheels = {0.98, 1.02, 0.0};
  Driven driven(drive);
  driven.Go(0, 20000);
  const std::string bytes = BytesOf(driven.learning());
  StateReader reader(bytes);
  OdometryLearning loaded({}, true);
  reader(loaded);
  ASSERT_TRUE(reader.done());
  EXPECT_EQ(BytesOf(loaded), bytes);
  Driven other = driven;
  other.learning() = loaded;
  driven.Go(20000, 30000);
  other.Go(20000, 30000);
  EXPECT_EQ(BytesOf(other.learning()), BytesOf(driven.learning()));
  EXPECT_EQ(other.last(), driven.last());
}

}  // namespace
}  // namespace cairn::slam
