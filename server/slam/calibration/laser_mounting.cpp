#include "server/slam/calibration/laser_mounting.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "common/geometry/pose_difference.h"
#include "server/slam/random/draws.h"

namespace cairn::slam {
namespace {

using Values = Eigen::Matrix<double, kLaserUnknowns, 1>;
using Information = Eigen::Matrix<double, kLaserUnknowns, kLaserUnknowns>;
using Row = Eigen::Matrix<double, 3, kLaserUnknowns>;
using Known = std::array<bool, kLaserUnknowns>;

// What is known before: standard deviations of robots as they are built. They only matter where a log shows nothing.
const Values kBefore = (Values() << 0.5, 0.1, 0.1, 0.1, 0.3, 0.3, 1.0).finished();
// With a larger doubt the log does not show the value.
const Values kLargestDoubt = (Values() << 0.03, 0.02, 0.02, 0.02, 0.05, 0.05, 0.05).finished();
const Values kDifference = (Values() << 0.005, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3).finished();
// Odometry within a pair, besides its systematic errors: a share of the way and of the turn, and the least.
constexpr double kSlip = 0.02, kLeast_m = 0.003, kLeast_rad = 0.003;
constexpr double kHuber = 2.0;  // In standard deviations.
constexpr int kIterations = 15, kMountingResamples = 200;
constexpr std::size_t kBlocks = 24;

Stamp Shifted(Stamp stamp, double seconds) {
  return static_cast<Stamp>(static_cast<std::uint64_t>(stamp) + static_cast<std::uint64_t>(StampFromSeconds(seconds)));
}

class MountingProblem {
 public:
  MountingProblem(std::span<const Odometry> odometry, std::span<const AlignedPair> pairs, const LaserGuess& guess)
      : odometry_(odometry), guess_(guess) {
    for (const AlignedPair& pair : pairs)
      if (pair.found && IsCovariance(pair.match.covariance)) pairs_.push_back(&pair);
  }

  [[nodiscard]] std::size_t pairs() const { return pairs_.size(); }

  [[nodiscard]] Values Start() const {
    const Pose2& T = guess_.T_robot_laser;
    return (Values() << guess_.lag_s, guess_.wheels.wheel_scale, guess_.wheels.turn_scale, guess_.wheels.turn_per_m,
            T.x, T.y, T.theta)
        .finished();
  }
  static WheelCorrection Wheels(const Values& v) { return {v(1), v(2), v(3)}; }
  static Pose2 Mounting(const Values& v) { return {v(4), v(5), WrapAngle(v(6))}; }

  // What odometry says of each pair; nothing where it does not cover it.
  [[nodiscard]] std::vector<std::optional<Pose2>> Steps(const Values& v) const {
    const OdometryPath path(odometry_, Wheels(v));
    std::vector<std::optional<Pose2>> steps;
    for (const AlignedPair* pair : pairs_) {
      const double later_s = guess_.lag_s - v(0);
      const auto a = path.At(Shifted(pair->first, later_s)), b = path.At(Shifted(pair->second, later_s));
      steps.push_back(a && b ? std::optional(Between(*a, *b)) : std::nullopt);
    }
    return steps;
  }

  // Match less odometry, in the frame of the first laser; zero where it is not known.
  [[nodiscard]] std::vector<Eigen::Vector3d> Residuals(const Values& v) const {
    const Pose2 T_robot_laser = Mounting(v);
    const auto steps = Steps(v);
    std::vector<Eigen::Vector3d> residuals(pairs_.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < pairs_.size(); ++i)
      if (steps[i])
        residuals[i] = Minus(pairs_[i]->match.T_ref_curr, Between(T_robot_laser, *steps[i] * T_robot_laser));
    return residuals;
  }

  // The square root of the information on each residual.
  [[nodiscard]] std::vector<Eigen::Matrix3d> Whitening(const Values& v) const {
    const auto steps = Steps(v);
    std::vector<Eigen::Matrix3d> whitening;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const Pose2 step = steps[i].value_or(Pose2{});
      const double way = kLeast_m + kSlip * step.translation().norm(), turn = kLeast_rad + kSlip * std::abs(step.theta);
      const Eigen::Matrix3d S = pairs_[i]->match.covariance + PoseCovariance(way, turn);
      const Eigen::Matrix3d information = S.ldlt().solve(Eigen::Matrix3d::Identity());
      whitening.push_back(information.llt().matrixL().transpose());
    }
    return whitening;
  }

 private:
  std::span<const Odometry> odometry_;
  const LaserGuess& guess_;
  std::vector<const AlignedPair*> pairs_;
};

struct Linear {
  std::vector<Information> H;  // Of each pair, with its weight.
  std::vector<Values> g;
  double sigma = 1.0;  // Of the whitened residuals: what the covariances understate.
};

Linear Linearise(const MountingProblem& problem, const Values& v) {
  const auto whitening = problem.Whitening(v);
  auto residuals = problem.Residuals(v);
  std::vector<Row> J(residuals.size(), Row::Zero());
  for (std::size_t k = 0; k < kLaserUnknowns; ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    Values plus = v, minus = v;
    plus(column) += kDifference(column);
    minus(column) -= kDifference(column);
    const auto a = problem.Residuals(plus), b = problem.Residuals(minus);
    for (std::size_t i = 0; i < J.size(); ++i)
      J[i].col(column) = whitening[i] * (a[i] - b[i]) / (2.0 * kDifference(column));
  }
  std::vector<double> sizes;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    residuals[i] = whitening[i] * residuals[i];
    if (residuals[i] != Eigen::Vector3d::Zero()) sizes.push_back(residuals[i].norm());
  }
  Linear linear;
  if (!sizes.empty()) {
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    linear.sigma = std::max(*middle / 1.538, 0.1);  // Median length of three standard normals.
  }
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double size = residuals[i].norm() / linear.sigma;
    const double weight = (size > kHuber ? kHuber / size : 1.0) / (linear.sigma * linear.sigma);
    linear.H.push_back(weight * J[i].transpose() * J[i]);
    linear.g.push_back(-weight * J[i].transpose() * residuals[i]);
  }
  return linear;
}

// Solves for the values that are not fixed; `before` pulls them to the start.
Values Solve(Information H, Values g, const Values& off_start, const Known& fixed) {
  for (Eigen::Index k = 0; k < H.rows(); ++k) {
    const double information = 1.0 / (kBefore(k) * kBefore(k));
    H(k, k) += information;
    g(k) -= information * off_start(k);
    if (!fixed[static_cast<std::size_t>(k)]) continue;
    H.row(k).setZero();
    H.col(k).setZero();
    H(k, k) = 1.0;
    g(k) = 0.0;
  }
  return H.ldlt().solve(g);
}

Values Minimise(const MountingProblem& problem, Values v, const Known& fixed) {
  const Values start = problem.Start();
  for (int k = 0; k < kIterations; ++k) {
    const Linear linear = Linearise(problem, v);
    Information H = Information::Zero();
    Values g = Values::Zero();
    for (std::size_t i = 0; i < linear.H.size(); ++i) {
      H += linear.H[i];
      g += linear.g[i];
    }
    const Values step = Solve(H, g, v - start, fixed);
    if (!step.allFinite()) break;
    v += step.cwiseMax(-kBefore).cwiseMin(kBefore);
    if ((step.cwiseAbs().array() < 1e-3 * kLargestDoubt.array()).all()) break;
  }
  return v;
}

// The lag at which turns agree best: the other values hardly matter for it. Nothing if other lags are about as good,
// as they are for a robot that drives straight ahead: the least squares would then only find a chance minimum.
std::optional<double> RoughLag(const MountingProblem& problem, const Values& start, double widest_s) {
  constexpr double kGrid_s = 0.02, kFarthest_rad = 0.15, kClearly = 0.8;
  double best = start(0), least = -1.0;
  std::vector<double> costs;
  const int steps = std::max(10, static_cast<int>(widest_s / kGrid_s));
  for (int k = -steps; k <= steps; ++k) {
    Values v = start;
    v(0) += k * kGrid_s;
    double sum = 0.0;
    std::size_t known = 0;  // A lag at which odometry does not cover the log must not look good.
    for (const Eigen::Vector3d& residual : problem.Residuals(v)) {
      if (residual == Eigen::Vector3d::Zero()) continue;
      sum += std::min(std::abs(residual.z()), kFarthest_rad);
      ++known;
    }
    if (2 * known < problem.pairs()) continue;
    sum = sum / static_cast<double>(known) + 1e-9 * std::abs(k);  // Among equals the nearest.
    costs.push_back(sum);
    if (least >= 0.0 && sum >= least) continue;
    least = sum;
    best = v(0);
  }
  if (costs.empty()) return std::nullopt;
  const auto middle = costs.begin() + static_cast<std::ptrdiff_t>(costs.size() / 2);
  std::nth_element(costs.begin(), middle, costs.end());
  if (least > kClearly * *middle) return std::nullopt;
  return widest_s > 0.0 ? best : start(0);
}

// The heading of the lidar at which the ways agree best.
double RoughHeading(const MountingProblem& problem, const Values& start) {
  constexpr int kHeadings = 24;
  constexpr double kFarthest_m = 0.15;
  double best = start(6), least = -1.0;
  for (int k = 0; k < kHeadings; ++k) {
    Values v = start;
    const int steps = (k + 1) / 2;  // 0, 1, 1, 2, 2, ... to both sides.
    v(6) += (k % 2 == 0 ? 1.0 : -1.0) * steps * 2.0 * kPi / kHeadings;
    double sum = 0.0;
    for (const Eigen::Vector3d& residual : problem.Residuals(v))
      sum += std::min(residual.head<2>().norm(), kFarthest_m);
    // Another heading than the supposed one has to be clearly better.
    if (least >= 0.0 && sum >= (best == start(6) ? 0.7 : 1.0) * least) continue;
    least = sum;
    best = v(6);
  }
  return best;
}

Values Doubts(const Linear& linear, const Known& fixed, std::uint64_t seed) {
  Information H = Information::Zero();
  for (const Information& one : linear.H) H += one;
  Values doubt = Values::Zero();
  Information inverse;
  for (Eigen::Index k = 0; k < H.rows(); ++k) inverse.col(k) = Solve(H, Values::Unit(k), Values::Zero(), fixed);
  for (Eigen::Index k = 0; k < H.rows(); ++k) doubt(k) = std::sqrt(std::max(0.0, inverse(k, k)));
  const std::size_t blocks = std::min(kBlocks, linear.H.size());
  if (blocks < 4) return doubt;
  Rng rng(seed);
  Values squares = Values::Zero();
  for (int n = 0; n < kMountingResamples; ++n) {
    Information H_drawn = Information::Zero();
    Values g_drawn = Values::Zero();
    for (std::size_t b = 0; b < blocks; ++b) {
      const auto drawn = static_cast<std::size_t>(UniformDraw(rng) * static_cast<double>(blocks));
      for (std::size_t i = drawn * linear.H.size() / blocks; i < (drawn + 1) * linear.H.size() / blocks; ++i) {
        H_drawn += linear.H[i];
        g_drawn += linear.g[i];
      }
    }
    squares += Solve(H_drawn, g_drawn, Values::Zero(), fixed).cwiseAbs2();
  }
  return doubt.cwiseMax((squares / kMountingResamples).cwiseSqrt());
}

}  // namespace

MountingFit FitMounting(std::span<const Odometry> odometry, std::span<const AlignedPair> pairs, const LaserGuess& guess,
                        double widest_lag_s, std::uint64_t seed) {
  const MountingProblem problem(odometry, pairs, guess);
  MountingFit fit{guess.lag_s, guess.wheels, guess.T_robot_laser, {}, {}, static_cast<int>(problem.pairs())};
  const Values start = problem.Start();
  for (std::size_t k = 0; k < kLaserUnknowns; ++k) fit.doubt[k] = kBefore(static_cast<Eigen::Index>(k));
  if (problem.pairs() < 10) return fit;
  Values v = start;
  const auto lag_s = RoughLag(problem, v, widest_lag_s);
  if (lag_s) v(0) = *lag_s;
  v(6) = RoughHeading(problem, v);
  Known fixed{};
  fixed[static_cast<std::size_t>(LaserUnknown::kLag)] = !lag_s;
  // What is not shown is fixed, and the rest is estimated again: the worst one first, as others may then be shown.
  for (std::size_t round = 0; round < kLaserUnknowns; ++round) {
    v = Minimise(problem, v, fixed);
    const Values doubt = Doubts(Linearise(problem, v), fixed, seed);
    double worst = 1.0;
    std::size_t which = kLaserUnknowns;
    for (std::size_t k = 0; k < kLaserUnknowns; ++k) {
      if (fixed[k]) continue;
      const auto row = static_cast<Eigen::Index>(k);
      fit.doubt[k] = doubt(row);
      if (doubt(row) / kLargestDoubt(row) <= worst) continue;
      worst = doubt(row) / kLargestDoubt(row);
      which = k;
    }
    if (which == kLaserUnknowns) break;
    fixed[which] = true;
    v(static_cast<Eigen::Index>(which)) = start(static_cast<Eigen::Index>(which));
  }
  for (std::size_t k = 0; k < kLaserUnknowns; ++k) fit.shown[k] = !fixed[k];
  fit.lag_s = v(0);
  fit.wheels = MountingProblem::Wheels(v);
  fit.T_robot_laser = MountingProblem::Mounting(v);
  return fit;
}

}  // namespace cairn::slam
