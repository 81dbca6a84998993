// Eliazar's probabilistic motion model: how a robot truly moved, given what its odometry says. A step is a turn B, a
// way D along the major axis (the heading plus B/2) and a way C across it; each is normal, with a mean linear in the
// odometry's way d and turn b and a variance linear in d^2 and b^2. Because variances grow with squares, parameters
// belong to steps of about the length they were learnt at.
// Not a tracker: one step, no state. Motions are T_prev_curr in the robot frame; m, rad. Engines are handed in.
// Source: thesis C 4.5.1, (4.46); Eliazar, Parr, "Learning probabilistic motion models for mobile robots", ICML 2004.
#pragma once

#include <Eigen/Core>
#include <random>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

// One of D, C, B given odometry (d, b): N(d mean_d + b mean_b, d^2 sigma_d^2 + b^2 sigma_b^2 + floor^2).
struct MotionTermModel {
  double mean_d = 0.0;
  double mean_b = 0.0;
  double sigma_d = 0.0;
  double sigma_b = 0.0;
  double floor = 0.0;  // Beyond the source: a robot whose odometry stands still is not quite certain to.

  [[nodiscard]] double Mean(double d, double b) const { return mean_d * d + mean_b * b; }
  [[nodiscard]] double Variance(double d, double b) const {
    return d * d * sigma_d * sigma_d + b * b * sigma_b * sigma_b + floor * floor;
  }
};

struct EliazarModel {
  MotionTermModel along{1.0, 0.0, 0.1, 0.05, 0.002};    // D, m.
  MotionTermModel across{0.0, 0.0, 0.05, 0.02, 0.002};  // C, m.
  MotionTermModel turn{0.0, 1.0, 0.1, 0.2, 0.002};      // B, rad.

  [[nodiscard]] const MotionTermModel& term(int i) const { return i == 0 ? along : i == 1 ? across : turn; }
  [[nodiscard]] MotionTermModel& term(int i) { return i == 0 ? along : i == 1 ? across : turn; }
};
inline constexpr int kMotionTerms = 3;  // D, C, B.
void Visit(OptionVisitor& visitor, EliazarModel& model);

// (D, C, B) of a motion, and back. A rotation of the translation by B/2, so densities keep their value.
[[nodiscard]] Eigen::Vector3d TermsOf(const Pose2& T_prev_curr);
[[nodiscard]] Pose2 MotionOf(const Eigen::Vector3d& terms);

// d and b: the odometry's way along its own major axis (negative backwards) and its turn.
struct OdometryStep {
  double d = 0.0;
  double b = 0.0;
};
[[nodiscard]] OdometryStep StepOf(const Pose2& T_prev_curr_odom);

// The motion by the mean of each term, and a draw of the true motion.
[[nodiscard]] Pose2 MeanMotion(const EliazarModel& model, const OdometryStep& step);
[[nodiscard]] Pose2 SampleMotion(const EliazarModel& model, const OdometryStep& step, std::mt19937_64& engine);

// ln p(terms | step). Variances must be above zero.
[[nodiscard]] double LogDensity(const EliazarModel& model, const OdometryStep& step, const Eigen::Vector3d& terms);

}  // namespace cairn::slam
