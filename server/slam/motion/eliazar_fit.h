// Learns Eliazar's motion model from steps that were measured both by odometry and by scan matching, by expectation
// maximisation. E: the true motion of every step as weighted particles, drawn from the model and from the match and
// weighted by both. M: means by weighted least squares, variances by weighted least squares of the squared residuals,
// repeated until they agree (Fisher scoring of the likelihood).
// The match's own error is thereby not counted as the robot's. Where a match says little (corridor), its covariance has
// to say so. Every iteration uses the same draws: the estimate converges instead of jittering, and the same seed gives
// the same bytes on any thread count. Stateless.
// Source: Eliazar, Parr, ICML 2004, section 4; thesis C 4.5.1.
#pragma once

#include <cstdint>
#include <span>

#include "server/slam/motion/eliazar_model.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct MeasuredStep {
  OdometryStep odometry;
  Pose2 T_prev_curr;                                         // By scan matching.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Of (x, y, theta), in prev; positive definite.
};

struct EliazarFitOptions {
  std::int64_t particles = 100;      // Per step, half drawn from the model and half from the match.
  std::int64_t max_iterations = 60;  // Of EM; typical fits stop below 30.
  double stop_change = 1e-4;         // Stops when no parameter moves by more.
  std::int64_t seed = 1;
};
void Visit(OptionVisitor& visitor, EliazarFitOptions& options);

struct EliazarFit {
  EliazarModel model;  // The floors are the start's: they are chosen, not learnt.
  int steps = 0;
  int iterations = 0;
  bool converged = false;
  double log_likelihood = 0.0;   // Per step, of the matches under the model.
  double effective_share = 0.0;  // Of the particles, mean over the steps.
};

// Without steps the model is the start's, not converged.
[[nodiscard]] EliazarFit FitEliazar(std::span<const MeasuredStep> steps, const EliazarModel& start,
                                    const EliazarFitOptions& options, const ParallelFor& parallel_for);

// First and second moment of (D, C, B) of one step, given what is known about it.
struct StepMoments {
  OdometryStep odometry;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
};

// The M step: the most likely parameters of one term, starting from `term`, whose floor stays.
[[nodiscard]] MotionTermModel FitTerm(std::span<const StepMoments> moments, int term_index,
                                      const MotionTermModel& term);

}  // namespace cairn::slam
