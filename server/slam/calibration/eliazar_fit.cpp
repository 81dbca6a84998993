#include "server/slam/calibration/eliazar_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "server/slam/calibration/spread_fit.h"
#include "server/slam/random/draws.h"

namespace cairn::slam {
namespace {

// Lower bound of the sigmas, per metre or radian: keeps variances above zero.
constexpr double kSmallestSigma = 1e-4;

// Result of the E step for one step.
struct Expectation {
  StepMoments moments;
  double log_likelihood = 0.0;
  double effective_share = 0.0;
};

Expectation Expect(const MeasuredStep& step, const EliazarModel& model, int particles, std::mt19937_64 engine) {
  const OdometryStep& odometry = step.odometry;
  const Eigen::LLT<Eigen::Matrix3d> cholesky(step.covariance);
  const double log_scale = -1.5 * std::log(2 * kPi) - cholesky.matrixLLT().diagonal().array().log().sum();
  const auto log_match = [&](const Eigen::Vector3d& terms) {
    const Pose2 motion = MotionOf(terms);
    Eigen::Vector3d error(motion.x - step.T_prev_curr.x, motion.y - step.T_prev_curr.y,
                          AngleDiff(motion.theta, step.T_prev_curr.theta));
    cholesky.matrixL().solveInPlace(error);
    return log_scale - 0.5 * error.squaredNorm();
  };
  // Half of the particles come from each of the two densities, with weights by the balance heuristic (Veach,
  // Guibas 1995), so that it does not matter which of the two is narrower.
  std::vector<Eigen::Vector3d> terms(static_cast<std::size_t>(particles));
  std::vector<double> log_weights(terms.size());
  double highest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const Eigen::Vector3d draws = ThreeNormalDraws(engine);
    if (i % 2 == 0) {
      for (int k = 0; k < kMotionTerms; ++k)
        terms[i](k) = model.term(k).Mean(odometry.d, odometry.b) +
                      std::sqrt(model.term(k).Variance(odometry.d, odometry.b)) * draws(k);
    } else {
      const Eigen::Vector3d off = cholesky.matrixL() * draws;
      terms[i] = TermsOf(
          {step.T_prev_curr.x + off.x(), step.T_prev_curr.y + off.y(), WrapAngle(step.T_prev_curr.theta + off.z())});
    }
    const double prior = LogDensity(model, odometry, terms[i]), match = log_match(terms[i]);
    const double larger = std::max(prior, match);
    const double mixture = larger + std::log(0.5 * std::exp(prior - larger) + 0.5 * std::exp(match - larger));
    log_weights[i] = prior + match - mixture;
    highest = std::max(highest, log_weights[i]);
  }
  Expectation result{{odometry}};
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const double weight = std::exp(log_weights[i] - highest);
    sum += weight;
    squares += weight * weight;
    result.moments.mean += weight * terms[i];
    result.moments.square += weight * terms[i].cwiseAbs2();
  }
  result.moments.mean /= sum;
  result.moments.square /= sum;
  result.log_likelihood = highest + std::log(sum / particles);
  result.effective_share = sum * sum / squares / particles;
  return result;
}

double Change(const EliazarModel& a, const EliazarModel& b) {
  double change = 0.0;
  for (int k = 0; k < kMotionTerms; ++k) {
    const MotionTermModel &s = a.term(k), &t = b.term(k);
    change = std::max({change, std::abs(s.mean_d - t.mean_d), std::abs(s.mean_b - t.mean_b),
                       std::abs(s.sigma_d - t.sigma_d), std::abs(s.sigma_b - t.sigma_b)});
  }
  return change;
}

}  // namespace

void Visit(OptionVisitor& visitor, EliazarFitOptions& options) {
  visitor.Integer("particles", options.particles, "1", 10, 100000,
                  "Number of particles for each step. More give a less noisy estimate and take more time.");
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 10000,
                  "Most iterations of expectation maximisation. A typical fit needs fewer than 30.");
  visitor.Real("stop_change", options.stop_change, "1", 0.0, 1.0, "The fit stops when no parameter changes by more.");
  visitor.Integer("seed", options.seed, "1", 0, std::numeric_limits<std::int64_t>::max(),
                  "Seed of the random numbers.");
}

MotionTermModel FitTerm(std::span<const StepMoments> moments, int term_index, const MotionTermModel& term) {
  MotionTermModel fit = term;
  std::vector<SpreadSample> samples(moments.size());
  for (int round = 0; round < 50; ++round) {
    // Means: normal equations over the steps, each weighted by its information.
    Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
    Eigen::Vector2d y = Eigen::Vector2d::Zero();
    for (const StepMoments& step : moments) {
      const Eigen::Vector2d z(step.odometry.d, step.odometry.b);
      const double certainty = 1.0 / std::max(fit.Variance(z.x(), z.y()), 1e-12);
      A += certainty * z * z.transpose();
      y += certainty * z * step.mean(term_index);
    }
    // A log without turns (or without translations) does not determine one of the two: it keeps its value.
    const Eigen::Vector2d before(fit.mean_d, fit.mean_b);
    const Eigen::Matrix2d ridge = Eigen::Matrix2d::Identity() * (1e-9 * A.trace() + 1e-12);
    const Eigen::Vector2d means = before + (A + ridge).ldlt().solve(y - A * before);
    fit.mean_d = means.x();
    fit.mean_b = means.y();

    for (std::size_t i = 0; i < moments.size(); ++i) {
      const StepMoments& step = moments[i];
      const double m = fit.Mean(step.odometry.d, step.odometry.b);
      const double square = step.square(term_index) - 2 * m * step.mean(term_index) + m * m;
      samples[i] = {step.odometry.d * step.odometry.d, step.odometry.b * step.odometry.b, std::max(square, 0.0), 1.0};
    }
    const Eigen::Vector2d variances = FitVariance(samples, {fit.sigma_d * fit.sigma_d, fit.sigma_b * fit.sigma_b},
                                                  fit.floor * fit.floor, kSmallestSigma * kSmallestSigma);
    const Eigen::Vector2d sigmas = variances.cwiseSqrt();
    const double change = std::max((means - before).cwiseAbs().maxCoeff(),
                                   (sigmas - Eigen::Vector2d(fit.sigma_d, fit.sigma_b)).cwiseAbs().maxCoeff());
    fit.sigma_d = sigmas.x();
    fit.sigma_b = sigmas.y();
    if (change < 1e-7) break;
  }
  return fit;
}

EliazarFit FitEliazar(std::span<const MeasuredStep> steps, const EliazarModel& start, const EliazarFitOptions& options,
                      const ParallelFor& parallel_for) {
  EliazarFit fit{.model = start, .steps = static_cast<int>(steps.size())};
  if (steps.empty()) return fit;
  std::vector<Expectation> expectations(steps.size());
  std::vector<StepMoments> moments(steps.size());
  while (fit.iterations < options.max_iterations && !fit.converged) {
    parallel_for(fit.steps, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const auto index = static_cast<std::size_t>(i);
        std::seed_seq seeds{static_cast<std::uint32_t>(options.seed), static_cast<std::uint32_t>(options.seed >> 32),
                            static_cast<std::uint32_t>(i)};
        expectations[index] =
            Expect(steps[index], fit.model, static_cast<int>(options.particles), std::mt19937_64(seeds));
      }
    });
    fit.log_likelihood = fit.effective_share = 0.0;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      moments[i] = expectations[i].moments;
      fit.log_likelihood += expectations[i].log_likelihood / fit.steps;
      fit.effective_share += expectations[i].effective_share / fit.steps;
    }
    EliazarModel next = fit.model;
    for (int k = 0; k < kMotionTerms; ++k) next.term(k) = FitTerm(moments, k, fit.model.term(k));
    fit.converged = Change(next, fit.model) < options.stop_change;
    fit.model = next;
    ++fit.iterations;
  }
  return fit;
}

}  // namespace cairn::slam
