// UMBmark: what systematic errors a differential drive has, from squares driven both ways round, and the wheel
// parameters that correct them. Both errors are needed in both directions: on one of them they can cancel.
// Not for the mean wheel size (a straight line of known length tells that): it is taken as given. REQUIRES runs steered
// by odometry, which believes in a true square; runs steered from outside come out right to first order only.
// Frame: poses are ends of runs in `start`, where the robot stood at first, its first leg along x; m, rad. Stateless.
// Source: thesis B 3.3.1-3.3.3, (3.7)..(3.11); Borenstein, Feng, "Measurement and correction of systematic odometry
// errors in mobile robots", IEEE T-RA 12(6), 1996 (angles alpha, beta; E_d, E_b; corrected parameters).
#pragma once

#include <Eigen/Core>
#include <span>

#include "common/status.h"
#include "server/slam/motion/differential_drive.h"

namespace cairn::slam {

// One run round the square, with its four turns.
struct SquareRun {
  bool clockwise = false;
  Pose2 measured;    // Where the robot ended, measured from outside ("abs").
  Pose2 calculated;  // Where odometry put it ("calc").
};

// (3.7): the return error, measured - calculated, its angle wrapped.
[[nodiscard]] Pose2 ReturnError(const SquareRun& run);

struct UmbmarkOptions {
  double side_m = 4.0;      // L, as odometry drives it.
  DifferentialDrive drive;  // What the odometry believes (nominal).
};
void Visit(OptionVisitor& visitor, UmbmarkOptions& options);

// What wheel errors do to odometry: E_d = D_R / D_L and E_b = b_actual / b_nominal, both 1 where nothing is wrong.
// (E_d counts on top of a difference the odometry already believes in.)
struct WheelErrors {
  double E_d = 1.0;
  double E_b = 1.0;
};

struct UmbmarkResult {
  int clockwise_runs = 0;
  int counter_runs = 0;
  Eigen::Vector2d center_cw = Eigen::Vector2d::Zero();  // (3.8)
  Eigen::Vector2d center_ccw = Eigen::Vector2d::Zero();
  double offset_cw_m = 0.0;  // (3.9)
  double offset_ccw_m = 0.0;
  double E_sys_m = 0.0;         // (3.10)
  double alpha_rad = 0.0;       // What a turn of 90 deg falls short by (type A, wheel base) ...
  double beta_rad = 0.0;        // ... and how much the robot turns on a straight leg (type B, wheel sizes).
  WheelErrors small_angle;      // Borenstein and Feng's formulas, for small alpha and beta.
  WheelErrors errors;           // The same by least squares on the exact path: what to use.
  WheelErrors sigma;            // Standard errors of `errors`, from the spread of the runs; 0 for one run each way.
  double E_sys_left_m = 0.0;    // What `errors` leaves unexplained of E_sys_m.
  DifferentialDrive corrected;  // The mean of the diameters stays.
};

// kInvalidArgument where a direction has no run, a pose is not finite, or the ends lie so far off that no wheels within
// +-20 % explain them.
[[nodiscard]] Result<UmbmarkResult> EvaluateUmbmark(std::span<const SquareRun> runs, const UmbmarkOptions& options);

// Where a robot with these wheel errors ends that believes it drove the square exactly: the model behind the fit.
[[nodiscard]] Pose2 SquareEnd(bool clockwise, const WheelErrors& errors, const UmbmarkOptions& options);

// (3.11): the average absolute heading error of runs over bumps, less the mean systematic one of the same direction
// (the thesis writes an index on the systematic errors, but runs over bumps have no partners among the smooth ones;
// Borenstein and Feng average). kInvalidArgument where a direction has runs of one kind only, or there are none.
[[nodiscard]] Result<double> NonSystematicError(std::span<const SquareRun> smooth, std::span<const SquareRun> bumpy);

}  // namespace cairn::slam
