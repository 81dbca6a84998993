// Random samples of the pose after a step, as FastSLAM 1.0 needs them. The models are the velocity model (an
// arc), the odometry model (turn, line, turn), and two models learnt for the robot.
// The velocity, the odometry and the scan matching model take the front-end's step, which thesis C calls
// "scan odometry" (4.2, 4.5.1, Tables 5.1-5.3). Eliazar's model takes the step that odometry reports, because
// d and b of (4.46) are reported odometry. The match then acts through the weights only, and a jump of the
// odometry moves all samples. Without odometry Eliazar's model takes the front-end's step as well, as in
// thesis C 4.5.1.
// The control is the step itself: velocities are per step, so the time between keyframes is 1. Stateless,
// thread-safe. Source: thesis C 4.2, Table 4.1, 4.5.1, 5.2, after Thrun et al. 2005, Tables 5.3 and 5.6.
// Corrected: line 1 of Table 4.1 uses alpha 1 twice. The function "sample" of the table gets variances made
// of squared velocities; otherwise driving backwards would give a negative variance.
#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/motion_models/learnt_motion.h"

namespace cairn::slam {

// The control of the velocity model: an arc, then a turn on the spot. The control is the step itself:
// velocities are per step, so the time between keyframes is 1. Stateless, thread-safe.
// Source: thesis C 4.2, Table 4.1; Thrun et al. 2005, Table 5.3.

// An arc of length v that turns by w, then a turn by g on the spot. A negative v means backwards. m, rad.
struct VelocityControl {
  double v = 0.0, w = 0.0, g = 0.0;
};
// Returns the control that leads exactly to this step.
[[nodiscard]] VelocityControl InverseVelocity(const Pose2& T_prev_curr);
// Lines 4-6 of Table 4.1.
[[nodiscard]] Pose2 ApplyVelocity(const Pose2& T_map_robot, const VelocityControl& control);

enum class MotionModel : std::uint8_t { kVelocity = 0, kOdometry, kEliazar, kScanMatching };

// Coefficients of the variances. In the velocity model, alpha_v_* give the variance of v, alpha_w_* that of w
// and alpha_g_* that of the final turn g, each from v^2 and w^2. The odometry model uses alpha_v_* for the
// line (from its length and the turns) and alpha_w_* for both turns (from the length and the turn itself).
struct MotionSampling {
  MotionModel model = MotionModel::kVelocity;
  double alpha_v_v = 3.2e-4, alpha_v_w = 2.5e-5;
  double alpha_w_v = 1.6e-5, alpha_w_w = 2.5e-5;
  double alpha_g_v = 1.6e-5, alpha_g_w = 2.5e-5;
  LearntMotion learnt{};  // In the configuration this is slam.motion.
};
void Visit(OptionVisitor& visitor, MotionModel& model);       // Reads the key `model`.
void Visit(OptionVisitor& visitor, MotionSampling& options);  // Reads all fields but `learnt`.

// The part of the step that the model takes as input.
[[nodiscard]] StepMotion InputOf(MotionModel model, const StepMotion& step);

// Returns a random sample of the pose after the step. `step` is a result of InputOf; its covariance is not
// used, because the model has noise of its own.
[[nodiscard]] Pose2 SampleMotion(const Pose2& T_map_robot, const StepMotion& step, const MotionSampling& options,
                                 std::mt19937_64& rng);

}  // namespace cairn::slam
