// UMBmark: estimates the systematic errors of a differential drive from squares driven in both directions,
// and the wheel parameters that correct them. Squares in both directions are needed, because in one direction
// the two errors can cancel.
// Does not estimate the mean wheel diameter, which is taken as given (it follows from a straight line of
// known length). REQUIRES: runs steered by odometry, so that the calculated path is a true square. For runs
// steered from outside the result is right to first order only.
// Frame: poses are ends of runs in `start`, the frame of the robot at the start with the first leg along x;
// m, rad. Stateless.
// Source: thesis B 3.3.1-3.3.3, (3.7)..(3.11); Borenstein, Feng, "Measurement and correction of systematic
// odometry errors in mobile robots", IEEE T-RA 12(6), 1996 (angles alpha, beta; E_d, E_b; corrected
// parameters).
#pragma once

#include <Eigen/Core>
#include <random>
#include <span>

#include "common/options/option_visitor.h"
#include "common/status.h"
#include "server/slam/calibration/differential_drive.h"

namespace cairn::slam {

// One run round the square, with its four turns.
struct SquareRun {
  bool clockwise = false;
  Pose2 measured;    // End pose measured from outside ("abs").
  Pose2 calculated;  // End pose by odometry ("calc").
};

// The return error (3.7): measured minus calculated, with the angle wrapped.
[[nodiscard]] Pose2 ReturnError(const SquareRun& run);

struct UmbmarkOptions {
  double side_m = 4.0;      // L: side of the square.
  DifferentialDrive drive;  // The nominal parameters, which the odometry assumes.
};

// Wheel errors as ratios: E_d = D_R / D_L and E_b = b_actual / b_nominal. Both are 1 without error. E_d comes
// in addition to a difference of the nominal diameters.
struct WheelErrors {
  double E_d = 1.0;
  double E_b = 1.0;
};

struct UmbmarkResult {
  int clockwise_runs = 0;
  int counter_runs = 0;
  Eigen::Vector2d center_cw = Eigen::Vector2d::Zero();  // Mean return error of the clockwise runs, (3.8).
  Eigen::Vector2d center_ccw = Eigen::Vector2d::Zero();
  double offset_cw_m = 0.0;  // Distance of that centre from zero, (3.9).
  double offset_ccw_m = 0.0;
  double E_sys_m = 0.0;     // Systematic error, (3.10).
  double alpha_rad = 0.0;   // Missing angle of a turn of 90 deg (type A, wheel base).
  double beta_rad = 0.0;    // Turn of the robot on a straight leg (type B, wheel diameters).
  WheelErrors small_angle;  // By Borenstein and Feng's formulas for small alpha and beta.
  WheelErrors errors;       // By least squares on the exact path; this is the result to use.
  // Standard errors of `errors` from the spread of the runs; 0 with one run each way.
  WheelErrors sigma;
  double E_sys_left_m = 0.0;    // Part of E_sys_m that `errors` does not explain.
  DifferentialDrive corrected;  // Corrected parameters; the mean of the diameters is unchanged.
};

// Error kInvalidArgument: one direction has no run, a pose is not finite, or the ends lie so far off that no
// wheel errors within +-20 % explain them.
[[nodiscard]] Result<UmbmarkResult> EvaluateUmbmark(std::span<const SquareRun> runs, const UmbmarkOptions& options);

// The end pose of a robot with these wheel errors that follows the square exactly by its odometry. This is
// the model behind the least squares.
[[nodiscard]] Pose2 SquareEnd(bool clockwise, const WheelErrors& errors, const UmbmarkOptions& options);

// The non-systematic error (3.11): the mean absolute heading error of runs over bumps, minus the mean
// systematic one of the same direction. The thesis writes an index on the systematic errors, but a run over
// bumps has no counterpart among the smooth ones, and Borenstein and Feng use the mean. Error
// kInvalidArgument: a direction has runs of one kind only, or there are no runs.
[[nodiscard]] Result<double> NonSystematicError(std::span<const SquareRun> smooth, std::span<const SquareRun> bumpy);

// Simulated runs round the UMBmark square, with which the calibration is tested. The robot has known wheel
// errors and drives what its odometry takes for the exact square, with random slip and, if wanted, bumps
// under its inner wheel.
// Frame: `start`, the first leg along x. The same engine state gives the same run. Stateless.
// Source: Borenstein, Feng 1996 (ten bumps along the path, under the wheel inside the square).
struct SquareRunOptions {
  WheelErrors errors;
  double slip_m_per_sqrt_m = 0.002;
  std::int64_t bumps = 0;
  double bump_m = 0.004;
};
void Visit(OptionVisitor& visitor, SquareRunOptions& options);

[[nodiscard]] SquareRun SimulateSquareRun(bool clockwise, const SquareRunOptions& run, const UmbmarkOptions& square,
                                          std::mt19937_64& engine);

}  // namespace cairn::slam
