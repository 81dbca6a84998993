// Eliazar's probabilistic motion model: the distribution of a robot's true step, given the step that its
// odometry reports. A step consists of a turn B, a translation D along the major axis (the heading plus B/2)
// and a translation C across it. Each is normally distributed, with a mean linear in the odometry's
// translation d and turn b, and a variance linear in d^2 and b^2. Since the variance grows with the square of
// the step, the parameters are valid only for steps of about the length they were learnt at.
// Not a tracker: it treats one step and has no state. Motions are T_prev_curr in the robot frame; m, rad. The
// caller passes the random engine.
// Source: thesis C 4.5.1, (4.46); Eliazar, Parr, "Learning probabilistic motion models for mobile robots",
// ICML 2004.
#pragma once

#include <Eigen/Core>
#include <random>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

// The distribution of one of D, C, B given odometry (d, b): N(d mean_d + b mean_b, d^2 sigma_d^2 + b^2
// sigma_b^2 + floor^2).
struct MotionTermModel {
  double mean_d = 0.0;
  double mean_b = 0.0;
  double sigma_d = 0.0;
  double sigma_b = 0.0;
  // Not in the source: some uncertainty remains even if the odometry reports no motion.
  double floor = 0.0;

  [[nodiscard]] double Mean(double d, double b) const { return mean_d * d + mean_b * b; }
  [[nodiscard]] double Variance(double d, double b) const {
    return d * d * sigma_d * sigma_d + b * b * sigma_b * sigma_b + floor * floor;
  }
};

struct EliazarModel {
  MotionTermModel along{1.0, 0.0, 0.1, 0.05, 0.002};    // The translation D along the major axis, m.
  MotionTermModel across{0.0, 0.0, 0.05, 0.02, 0.002};  // The translation C across it, m.
  MotionTermModel turn{0.0, 1.0, 0.1, 0.2, 0.002};      // The turn B, rad.

  [[nodiscard]] const MotionTermModel& term(int i) const { return i == 0 ? along : i == 1 ? across : turn; }
  [[nodiscard]] MotionTermModel& term(int i) { return i == 0 ? along : i == 1 ? across : turn; }
};
inline constexpr int kMotionTerms = 3;  // The terms D, C and B.
void Visit(OptionVisitor& visitor, EliazarModel& model);

// Converts a motion to (D, C, B) and back. This rotates the translation by B/2, which leaves densities
// unchanged.
[[nodiscard]] Eigen::Vector3d TermsOf(const Pose2& T_prev_curr);
[[nodiscard]] Pose2 MotionOf(const Eigen::Vector3d& terms);

// The odometry's step: d is the translation along its own major axis (negative backwards), b the turn.
struct OdometryStep {
  double d = 0.0;
  double b = 0.0;
};
[[nodiscard]] OdometryStep StepOf(const Pose2& T_prev_curr_odom);

// The motion that consists of the mean of each term, and a random sample of the true motion.
[[nodiscard]] Pose2 MeanMotion(const EliazarModel& model, const OdometryStep& step);
[[nodiscard]] Pose2 SampleMotion(const EliazarModel& model, const OdometryStep& step, std::mt19937_64& engine);

// Returns ln p(terms | step). REQUIRES: variances above zero.
[[nodiscard]] double LogDensity(const EliazarModel& model, const OdometryStep& step, const Eigen::Vector3d& terms);

}  // namespace cairn::slam
