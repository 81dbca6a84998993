#include "server/slam/calibration/umbmark.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

#include "server/slam/random/draws.h"

namespace cairn::slam {
namespace {

struct Direction {
  int runs = 0;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double mean_turn = 0.0;
  double squares = 0.0;  // Sum of the squared distances from the centre.
};

Direction Summarise(std::span<const SquareRun> runs, bool clockwise) {
  Direction sum;
  for (const SquareRun& run : runs) {
    if (run.clockwise != clockwise) continue;
    ++sum.runs;
    sum.center += ReturnError(run).translation();
    sum.mean_turn += ReturnError(run).theta;
  }
  if (sum.runs == 0) return sum;
  sum.center /= sum.runs;
  sum.mean_turn /= sum.runs;
  for (const SquareRun& run : runs)
    if (run.clockwise == clockwise) sum.squares += (ReturnError(run).translation() - sum.center).squaredNorm();
  return sum;
}

// Correction factors c_L and c_R of Borenstein and Feng, which leave the mean of the two diameters unchanged.
double LeftFactor(double E_d) {
  return 2.0 / (E_d + 1.0);
}
double RightFactor(double E_d) {
  return 2.0 / (1.0 / E_d + 1.0);
}

Eigen::Vector4d EndsOf(const Eigen::Vector2d& parameters, const UmbmarkOptions& options) {
  const WheelErrors errors{parameters(0), parameters(1)};
  Eigen::Vector4d ends;
  ends << SquareEnd(true, errors, options).translation(), SquareEnd(false, errors, options).translation();
  return ends;
}

Eigen::Matrix<double, 4, 2> J_ends_errors(const Eigen::Vector2d& parameters, const UmbmarkOptions& options) {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 4, 2> J;
  for (int i = 0; i < 2; ++i) {
    Eigen::Vector2d ahead = parameters, behind = parameters;
    ahead(i) += kStep;
    behind(i) -= kStep;
    J.col(i) = (EndsOf(ahead, options) - EndsOf(behind, options)) / (2 * kStep);
  }
  return J;
}

bool IsPlausible(const Eigen::Vector2d& parameters) {
  return parameters.allFinite() && (parameters.array() > 0.8).all() && (parameters.array() < 1.25).all();
}

}  // namespace

Pose2 ReturnError(const SquareRun& run) {
  return {run.measured.x - run.calculated.x, run.measured.y - run.calculated.y,
          AngleDiff(run.measured.theta, run.calculated.theta)};
}

Pose2 SquareEnd(bool clockwise, const WheelErrors& errors, const UmbmarkOptions& options) {
  const double base = options.drive.base_m, turn = clockwise ? -kPi / 2 : kPi / 2;
  const double left = LeftFactor(errors.E_d), right = RightFactor(errors.E_d);
  const auto truly = [&](const WheelTravel& believed) {
    return MotionOfTravel({believed.left_m * left, believed.right_m * right}, base * errors.E_b);
  };
  const Pose2 side = truly(TravelOfArc(options.side_m, 0.0, base)) * truly(TravelOfArc(0.0, turn, base));
  return side * side * side * side;
}

Result<UmbmarkResult> EvaluateUmbmark(std::span<const SquareRun> runs, const UmbmarkOptions& options) {
  if (std::any_of(runs.begin(), runs.end(),
                  [](const SquareRun& run) { return !run.measured.IsFinite() || !run.calculated.IsFinite(); }))
    return Fail(StatusCode::kInvalidArgument, "a run's end is not finite");
  const Direction cw = Summarise(runs, true), ccw = Summarise(runs, false);
  if (cw.runs == 0 || ccw.runs == 0)
    return Fail(StatusCode::kInvalidArgument, "runs in both directions are needed: " + std::to_string(cw.runs) +
                                                  " clockwise, " + std::to_string(ccw.runs) + " counter-clockwise");
  UmbmarkResult result;
  result.clockwise_runs = cw.runs;
  result.counter_runs = ccw.runs;
  result.center_cw = cw.center;
  result.center_ccw = ccw.center;
  result.offset_cw_m = cw.center.norm();
  result.offset_ccw_m = ccw.center.norm();
  result.E_sys_m = std::max(result.offset_cw_m, result.offset_ccw_m);

  // To first order in alpha and beta, cw ends at -2L (alpha + beta) (1, 1) and ccw at -2L (alpha - beta) (1,
  // -1). Both coordinates give the same value; their mean halves the variance.
  const double scale = -4.0 * options.side_m;
  const double sum_cw = (cw.center.x() + cw.center.y()) / 2, sum_ccw = (ccw.center.x() - ccw.center.y()) / 2;
  result.alpha_rad = (sum_cw + sum_ccw) / scale;
  result.beta_rad = (sum_cw - sum_ccw) / scale;
  const double half_base_per_radius =
      options.drive.base_m / 2 * 2 * std::sin(result.beta_rad / 2) / options.side_m;  // b / 2R
  result.small_angle.E_b = kPi / 2 / (kPi / 2 - result.alpha_rad);
  result.small_angle.E_d = (1 + half_base_per_radius) / (1 - half_base_per_radius);

  const auto beyond = [] {
    return Fail(StatusCode::kInvalidArgument,
                "the runs end so far off that no wheel errors within 20 % explain them: are they all of this square, "
                "in metres, with the first leg along x?");
  };
  Eigen::Vector2d x(result.small_angle.E_d, result.small_angle.E_b);
  if (!IsPlausible(x)) return beyond();
  Eigen::Vector4d centers;
  centers << cw.center, ccw.center;
  Eigen::Matrix<double, 4, 2> J;
  for (int i = 0; i < 20; ++i) {  // Gauss-Newton, which needs two or three steps.
    J = J_ends_errors(x, options);
    const Eigen::Vector2d step = (J.transpose() * J).ldlt().solve(J.transpose() * (centers - EndsOf(x, options)));
    x += step;
    if (!IsPlausible(x)) return beyond();
    if (step.norm() < 1e-12) break;
  }
  result.errors = {x(0), x(1)};
  const Eigen::Vector4d left = centers - EndsOf(x, options);
  result.E_sys_left_m = std::max(left.head<2>().norm(), left.tail<2>().norm());
  if (const int free = 2 * (cw.runs + ccw.runs - 2); free > 0) {
    const double variance = (cw.squares + ccw.squares) / free;  // Variance of one coordinate of one run.
    Eigen::Vector4d of_center;
    of_center << variance / cw.runs, variance / cw.runs, variance / ccw.runs, variance / ccw.runs;
    const Eigen::Matrix<double, 2, 4> gain = (J.transpose() * J).ldlt().solve(J.transpose());
    const Eigen::Matrix2d covariance = gain * of_center.asDiagonal() * gain.transpose();
    result.sigma = {std::sqrt(covariance(0, 0)), std::sqrt(covariance(1, 1))};
  }
  result.corrected = options.drive;
  result.corrected.base_m *= result.errors.E_b;
  result.corrected.left_diameter_m *= LeftFactor(result.errors.E_d);
  result.corrected.right_diameter_m *= RightFactor(result.errors.E_d);
  return result;
}

Result<double> NonSystematicError(std::span<const SquareRun> smooth, std::span<const SquareRun> bumpy) {
  double error = 0.0;
  bool any = false;
  for (const bool clockwise : {true, false}) {
    const Direction systematic = Summarise(smooth, clockwise);
    int runs = 0;
    double sum = 0.0;
    for (const SquareRun& run : bumpy) {
      if (run.clockwise != clockwise) continue;
      ++runs;
      sum += std::abs(AngleDiff(ReturnError(run).theta, systematic.mean_turn));
    }
    if (runs == 0) continue;
    if (systematic.runs == 0)
      return Fail(StatusCode::kInvalidArgument, std::string("runs over bumps need smooth runs to compare with: none ") +
                                                    (clockwise ? "clockwise" : "counter-clockwise"));
    error += sum / runs;
    any = true;
  }
  if (!any) return Fail(StatusCode::kInvalidArgument, "no runs over bumps");
  return error;
}

void Visit(OptionVisitor& visitor, SquareRunOptions& options) {
  visitor.Real("E_d", options.errors.E_d, "1", 0.9, 1.1,
               "True diameter of the right wheel divided by that of the left one.");
  visitor.Real("E_b", options.errors.E_b, "1", 0.9, 1.1,
               "True wheel base divided by the one that the odometry assumes.");
  visitor.Real("slip_m_per_sqrt_m", options.slip_m_per_sqrt_m, "m", 0.0, 0.1,
               "Standard deviation of the way of a wheel after 1 m.");
  visitor.Integer("bumps", options.bumps, "1", 0, 1000, "Number of bumps along the square, under the inner wheel.");
  visitor.Real("bump_m", options.bump_m, "m", 0.0, 0.1, "Way that a bump takes from a wheel.");
}

SquareRun SimulateSquareRun(bool clockwise, const SquareRunOptions& run, const UmbmarkOptions& square,
                            std::mt19937_64& engine) {
  // Slip bends the path at every point, so the run is simulated in short steps.
  constexpr double kStep_m = 0.05;
  constexpr double kStep_rad = 0.05;
  const double base = square.drive.base_m;
  const double left = 2.0 / (run.errors.E_d + 1.0), right = 2.0 / (1.0 / run.errors.E_d + 1.0);
  SquareRun result{clockwise, {}, {}};
  const auto drive = [&](double way, double turn, double inner_bump) {
    const WheelTravel believed = TravelOfArc(way, turn, base);
    WheelTravel travel{believed.left_m * left, believed.right_m * right};
    travel.left_m += run.slip_m_per_sqrt_m * std::sqrt(std::abs(travel.left_m)) * NormalDraw(engine);
    travel.right_m += run.slip_m_per_sqrt_m * std::sqrt(std::abs(travel.right_m)) * NormalDraw(engine);
    (clockwise ? travel.right_m : travel.left_m) -= inner_bump;
    result.measured = result.measured * MotionOfTravel(travel, base * run.errors.E_b);
    result.calculated = result.calculated * MotionOfTravel(believed, base);
  };
  const int steps = std::max(1, static_cast<int>(std::ceil(square.side_m / kStep_m)));
  const int turns = std::max(1, static_cast<int>(std::ceil(kPi / 2 / kStep_rad)));
  std::int64_t passed = 0;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < steps; ++i) {
      // The k-th of n bumps lies at the share (k + 1/2) / n of the path.
      const std::int64_t reached = (2 * run.bumps * (side * steps + i + 1) + 4 * steps) / (8 * steps);
      drive(square.side_m / steps, 0.0, static_cast<double>(reached - passed) * run.bump_m);
      passed = reached;
    }
    for (int i = 0; i < turns; ++i) drive(0.0, (clockwise ? -kPi / 2 : kPi / 2) / turns, 0.0);
  }
  return result;
}

}  // namespace cairn::slam
