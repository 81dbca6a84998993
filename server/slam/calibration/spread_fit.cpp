#include "server/slam/calibration/spread_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

constexpr int kMaxSpreadRounds = 100;
constexpr double kStop = 1e-9;  // Relative change at which the iteration stops.

struct Equations {
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d y = Eigen::Vector2d::Zero();
};

// Minimum of a quadratic under the bound that no coordinate is below `least`: where one would be, it is set
// to the bound and the other is solved for alone.
Eigen::Vector2d SolveAbove(const Equations& e, double least, const Eigen::Vector2d& fallback) {
  const auto alone = [&](int free) {
    Eigen::Vector2d x = Eigen::Vector2d::Constant(least);
    if (e.A(free, free) <= 0.0) return fallback;
    x(free) = std::max(least, (e.y(free) - e.A(free, 1 - free) * least) / e.A(free, free));
    return x;
  };
  if (e.A(0, 0) <= 0.0 && e.A(1, 1) <= 0.0) return fallback;
  const double determinant = e.A(0, 0) * e.A(1, 1) - e.A(0, 1) * e.A(1, 0);
  if (determinant <= 1e-12 * e.A(0, 0) * e.A(1, 1)) return alone(e.A(0, 0) >= e.A(1, 1) ? 0 : 1);
  Eigen::Vector2d x = e.A.ldlt().solve(e.y);
  if (x(0) >= least && x(1) >= least) return x;
  const Eigen::Vector2d first = alone(0), second = alone(1);
  const auto cost = [&](const Eigen::Vector2d& p) { return 0.5 * p.dot(e.A * p) - e.y.dot(p); };
  return cost(first) <= cost(second) ? first : second;
}

template <typename Assemble>
Eigen::Vector2d Iterate(Eigen::Vector2d x, double least, const Assemble& assemble) {
  for (int round = 0; round < kMaxSpreadRounds; ++round) {
    const Eigen::Vector2d next = SolveAbove(assemble(x), least, x);
    const double change = ((next - x).cwiseAbs().array() / (x.cwiseAbs().array() + least)).maxCoeff();
    x = next;
    if (change < kStop) break;
  }
  return x;
}

}  // namespace

Eigen::Vector2d FitVariance(std::span<const SpreadSample> samples, const Eigen::Vector2d& start, double constant,
                            double least) {
  return Iterate(start.cwiseMax(least), least, [&](const Eigen::Vector2d& v) {
    Equations e;
    for (const SpreadSample& sample : samples) {
      const Eigen::Vector2d z(sample.first, sample.second);
      const double variance = std::max(z.dot(v) + constant, 1e-16);
      // The variance of a squared error is 2 variance^2.
      const double weight = sample.weight / (variance * variance);
      e.A += weight * z * z.transpose();
      e.y += weight * z * (sample.square - constant);
    }
    return e;
  });
}

Eigen::Vector2d FitSigma(std::span<const SpreadSample> samples, const Eigen::Vector2d& start, double least) {
  return Iterate(start.cwiseMax(least), least, [&](const Eigen::Vector2d& s) {
    Equations e;
    for (const SpreadSample& sample : samples) {
      const Eigen::Vector2d z(sample.first, sample.second);
      const double sigma = std::max(z.dot(s), 1e-12);
      // The score is (square - sigma^2) / sigma^3 z and the information 2 / sigma^2 z z', so the step is a
      // regression of the working value.
      const double weight = 2.0 * sample.weight / (sigma * sigma);
      const double working = sigma + (sample.square - sigma * sigma) / (2.0 * sigma);
      e.A += weight * z * z.transpose();
      e.y += weight * z * working;
    }
    return e;
  });
}

}  // namespace cairn::slam
