#include "server/slam/calibration/umbmark.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "client/sim/wheels.h"

namespace cairn::slam {
namespace {

std::vector<SquareRun> PerfectRuns(const WheelErrors& errors, const UmbmarkOptions& options) {
  return {{true, SquareEnd(true, errors, options), {}}, {false, SquareEnd(false, errors, options), {}}};
}

// By hand: alpha = beta = 0.01 rad, L = 4: cw ends at -2 * 4 * 0.02 = -0.16 in x and y, ccw at 0.
TEST(Umbmark, SeparatesTheTwoErrorsOfAHandWorkedCase) {
  const std::vector<SquareRun> runs = {{true, {-0.16, -0.16, 0.08}, {}}, {false, {0.0, 0.0, 0.0}, {}}};
  UmbmarkOptions options;
  options.drive.base_m = 0.34;
  const auto result = EvaluateUmbmark(runs, options);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(result->alpha_rad, 0.01, 1e-12);
  EXPECT_NEAR(result->beta_rad, 0.01, 1e-12);
  EXPECT_NEAR(result->small_angle.E_b, (kPi / 2) / (kPi / 2 - 0.01), 1e-12);
  const double R = 2.0 / std::sin(0.005);
  EXPECT_NEAR(result->small_angle.E_d, (R + 0.17) / (R - 0.17), 1e-12);
  EXPECT_NEAR(result->E_sys_m, 0.16 * std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(result->offset_ccw_m, 0.0, 1e-12);
}

TEST(Umbmark, PerfectWheelsNeedNoCorrection) {
  const UmbmarkOptions options;
  const auto result = EvaluateUmbmark(PerfectRuns({}, options), options);
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->errors.E_d, 1.0, 1e-9);
  EXPECT_NEAR(result->errors.E_b, 1.0, 1e-9);
  EXPECT_NEAR(result->E_sys_m, 0.0, 1e-9);
}

TEST(Umbmark, ErrorsAreRecoveredExactlyWithoutNoise) {
  for (const double E_d : {0.97, 0.999, 1.0, 1.004, 1.03}) {
    for (const double E_b : {0.95, 1.0, 1.002, 1.05}) {
      UmbmarkOptions options;
      options.side_m = 4.0;
      const auto result = EvaluateUmbmark(PerfectRuns({E_d, E_b}, options), options);
      ASSERT_TRUE(result) << E_d << " " << E_b << ": " << result.error().message;
      EXPECT_NEAR(result->errors.E_d, E_d, 1e-8) << E_b;
      EXPECT_NEAR(result->errors.E_b, E_b, 1e-8) << E_d;
      EXPECT_NEAR(result->E_sys_left_m, 0.0, 1e-8);
    }
  }
}

// The published formulas hold for small errors only; on a large one the exact fit is clearly better.
TEST(Umbmark, TheSmallAngleFormulasAreOfFirstOrder) {
  const UmbmarkOptions options;
  const auto error = [&](double scale) {
    const WheelErrors injected{1.0 + 0.004 * scale, 1.0 + 0.004 * scale};
    const auto result = EvaluateUmbmark(PerfectRuns(injected, options), options);
    EXPECT_TRUE(result);
    return std::abs(result->small_angle.E_d - injected.E_d) + std::abs(result->small_angle.E_b - injected.E_b);
  };
  EXPECT_LT(error(1.0), 1e-3);
  EXPECT_NEAR(error(1.0) / error(0.5), 4.0, 1.5) << "second order is what is left";
}

TEST(Umbmark, InjectedErrorsComeBackWithinTheirStandardErrors) {
  int within_d = 0, within_b = 0;
  const int trials = 200;
  for (int trial = 0; trial < trials; ++trial) {
    std::mt19937_64 engine(100 + trial);
    const UmbmarkOptions options;
    SquareRunOptions run;
    run.errors = {1.006, 0.985};
    std::vector<SquareRun> runs;
    for (int i = 0; i < 10; ++i) runs.push_back(SimulateSquareRun(i % 2 == 0, run, options, engine));
    const auto result = EvaluateUmbmark(runs, options);
    ASSERT_TRUE(result);
    EXPECT_NEAR(result->errors.E_d, 1.006, 0.0015);
    EXPECT_NEAR(result->errors.E_b, 0.985, 0.008);
    within_d += std::abs(result->errors.E_d - 1.006) < 2 * result->sigma.E_d;
    within_b += std::abs(result->errors.E_b - 0.985) < 2 * result->sigma.E_b;
  }
  // The nominal share is 95 %. The errors of x and y of one run are correlated, which the plain standard
  // error ignores.
  EXPECT_GT(within_d, trials * 80 / 100);
  EXPECT_GT(within_b, trials * 80 / 100);
}

TEST(Umbmark, TheCorrectedDriveEndsWhereItBelieves) {
  UmbmarkOptions options;
  SquareRunOptions run;
  run.errors = {1.012, 1.03};
  run.slip_m_per_sqrt_m = 0.0;
  std::mt19937_64 engine(1);
  const auto result = EvaluateUmbmark(
      std::vector{SimulateSquareRun(true, run, options, engine), SimulateSquareRun(false, run, options, engine)},
      options);
  ASSERT_TRUE(result);
  // A robot with the true geometry whose software now uses the corrected geometry has no error left.
  const DifferentialDrive& c = result->corrected;
  EXPECT_NEAR(c.right_diameter_m / c.left_diameter_m, 1.012, 1e-5);
  EXPECT_NEAR(c.base_m / options.drive.base_m, 1.03, 1e-5);
  EXPECT_NEAR(c.right_diameter_m + c.left_diameter_m, options.drive.right_diameter_m + options.drive.left_diameter_m,
              1e-12);
}

// An independent simulator (the wheels of the simulated fleet) confirms the errors: it drives the true path
// for which the odometry reads an exact square.
TEST(Umbmark, AgreesWithTheFleetSimulatorsWheels) {
  const double E_d = 1.007, E_b = 1.012;
  sim::WheelOptions wheels;
  wheels.base_m = 0.45;
  wheels.left_share = (E_d + 1) / 2 - 1;  // The left wheel is smaller than assumed, so the odometry reads too much.
  wheels.right_share = (1 / E_d + 1) / 2 - 1;
  wheels.base_share = 1 / E_b - 1;
  wheels.slip_m_per_sqrt_m = 0.0;
  UmbmarkOptions options;
  options.drive.base_m = wheels.base_m / E_b;
  std::vector<SquareRun> runs;
  for (const bool clockwise : {true, false}) {
    sim::Random random(1);
    sim::WheelOdometry odometry(wheels);
    Pose2 truth;
    const auto read = [&](double left_m, double right_m) {
      const double left = left_m / (1 + wheels.left_share), right = right_m / (1 + wheels.right_share);
      odometry.Drive((left + right) / 2, (right - left) / wheels.base_m, random);
      truth = truth * MotionOfTravel({left, right}, wheels.base_m);
    };
    const double corner = (clockwise ? -1 : 1) * kPi / 4 * options.drive.base_m;
    for (int side = 0; side < 4; ++side) {
      read(options.side_m, options.side_m);
      read(-corner, corner);
    }
    EXPECT_NEAR(odometry.T_odom_robot().translation().norm(), 0.0, 1e-9) << "odometry believes it is back";
    runs.push_back({clockwise, truth, odometry.T_odom_robot()});
  }
  const auto result = EvaluateUmbmark(runs, options);
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->errors.E_d, E_d, 1e-7);
  EXPECT_NEAR(result->errors.E_b, E_b, 1e-7);
}

TEST(NonSystematicError, IsTheMeanAbsoluteTurnBeyondTheSystematicOne) {
  const std::vector<SquareRun> smooth = {
      {true, {0, 0, 0.02}, {}}, {true, {0, 0, 0.04}, {}}, {false, {0, 0, -0.01}, {}}};
  const std::vector<SquareRun> bumpy = {{true, {0, 0, 0.08}, {}}, {true, {0, 0, -0.01}, {}}, {false, {0, 0, 0.01}, {}}};
  const auto error = NonSystematicError(smooth, bumpy);  // cw: (0.05 + 0.04) / 2; ccw: 0.02. Signs must not cancel.
  ASSERT_TRUE(error);
  EXPECT_NEAR(*error, 0.065, 1e-12);
}

TEST(NonSystematicError, CountsBumpsAndNotWheelErrors) {
  const UmbmarkOptions options;
  SquareRunOptions run;
  run.errors = {1.01, 0.98};
  run.slip_m_per_sqrt_m = 0.0;
  std::mt19937_64 engine(1);
  std::vector<SquareRun> smooth, bumpy;
  for (const bool clockwise : {true, false}) {
    smooth.push_back(SimulateSquareRun(clockwise, run, options, engine));
    run.bumps = 10;
    bumpy.push_back(SimulateSquareRun(clockwise, run, options, engine));
    run.bumps = 0;
  }
  const auto error = NonSystematicError(smooth, bumpy);
  ASSERT_TRUE(error);
  EXPECT_NEAR(*error, 2 * 10 * run.bump_m / (options.drive.base_m * 0.98), 1e-9);
}

TEST(Umbmark, RefusesWhatItCannotUse) {
  const UmbmarkOptions options;
  EXPECT_FALSE(EvaluateUmbmark({}, options));
  EXPECT_FALSE(EvaluateUmbmark(std::vector<SquareRun>{{true, {}, {}}}, options));
  EXPECT_FALSE(EvaluateUmbmark(std::vector<SquareRun>{{true, {}, {}}, {false, {NAN, 0, 0}, {}}}, options));
  const auto far = EvaluateUmbmark(std::vector<SquareRun>{{true, {160, 0, 0}, {}}, {false, {12, 0, 0}, {}}}, options);
  ASSERT_FALSE(far);
  EXPECT_THAT(far.error().message, ::testing::HasSubstr("far off"));
  EXPECT_FALSE(NonSystematicError({}, {}));
  EXPECT_FALSE(NonSystematicError({}, std::vector<SquareRun>{{true, {}, {}}}));
}

}  // namespace
}  // namespace cairn::slam
