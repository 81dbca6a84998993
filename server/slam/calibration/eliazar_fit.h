// Learns Eliazar's motion model by expectation maximisation, from steps that were measured both by odometry
// and by scan matching.
// E step: the true motion of every step as weighted particles, drawn from the model and from the match and
// weighted by both. M step: means by weighted least squares, variances by weighted least squares of the
// squared residuals, repeated until they agree (Fisher scoring of the likelihood).
// In this way the error of the match is not attributed to the robot. A match that shows little (corridor)
// must therefore have a large covariance. Every iteration uses the same random numbers, so that the estimate
// converges instead of fluctuating, and the same seed gives the same bytes on any number of threads.
// Stateless.
// Source: Eliazar, Parr, ICML 2004, section 4; thesis C 4.5.1.
#pragma once

#include <cstdint>
#include <span>

#include "server/slam/motion_models/eliazar_model.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct MeasuredStep {
  OdometryStep odometry;
  Pose2 T_prev_curr;  // The step measured by scan matching.
  // Covariance of the match, (x, y, theta) in prev; positive definite.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

struct EliazarFitOptions {
  std::int64_t particles = 100;  // Half are drawn from the model and half from the match.
  std::int64_t max_iterations = 60;
  double stop_change = 1e-4;
  std::int64_t seed = 1;
};
void Visit(OptionVisitor& visitor, EliazarFitOptions& options);

struct EliazarFit {
  EliazarModel model;  // The floors are those of the start model; they are not learnt.
  int steps = 0;
  int iterations = 0;
  bool converged = false;
  double log_likelihood = 0.0;  // Mean log likelihood per step of the matches under the model.
  // Effective share of the particles (effective sample size over their number), mean over the steps.
  double effective_share = 0.0;
};

// Without steps the result is the start model, not converged.
[[nodiscard]] EliazarFit FitEliazar(std::span<const MeasuredStep> steps, const EliazarModel& start,
                                    const EliazarFitOptions& options, const ParallelFor& parallel_for);

// Mean and mean square of (D, C, B) of one step, given its odometry and its match.
struct StepMoments {
  OdometryStep odometry;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
};

// The M step: the most likely parameters of one term, starting from `term`. The floor is not changed.
[[nodiscard]] MotionTermModel FitTerm(std::span<const StepMoments> moments, int term_index,
                                      const MotionTermModel& term);

}  // namespace cairn::slam
