// Samples of where a step may have led, as FastSLAM 1.0 needs them: the velocity model (an arc) and the odometry model
// (turn, line, turn). A control is the step itself: velocities per step, so the time between keyframes is 1.
// Random engines are passed in. Stateless, thread-safe.
// Source: thesis C 4.2, Table 4.1, after Thrun et al. 2005, Tables 5.3 and 5.6. Corrected: line 1 of Table 4.1 uses
// alpha 1 twice, and "sample" takes variances of squared velocities, or driving backwards would have negative noise.
#pragma once

#include <cstdint>
#include <random>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

enum class MotionModel : std::uint8_t { kVelocity = 0, kOdometry };

// Variances: of v by v^2 and w^2, of w by v^2 and w^2, of the final turn g by v^2 and w^2. The odometry model uses the
// first for the line (by its length and the turns), the second for both turns (by the length and each turn).
struct MotionSampling {
  MotionModel model = MotionModel::kVelocity;
  double alpha_v_v = 3.2e-4, alpha_v_w = 2.5e-5;
  double alpha_w_v = 1.6e-5, alpha_w_w = 2.5e-5;
  double alpha_g_v = 1.6e-5, alpha_g_w = 2.5e-5;
};
void Visit(OptionVisitor& visitor, MotionSampling& options);

// An arc of length v that turns by w, then a turn g on the spot; v < 0: backwards.
struct VelocityControl {
  double v = 0.0, w = 0.0, g = 0.0;
};
// The control that makes the step exactly.
[[nodiscard]] VelocityControl InverseVelocity(const Pose2& T_prev_curr);
[[nodiscard]] Pose2 ApplyVelocity(const Pose2& T_map_robot, const VelocityControl& control);  // Lines 4-6.

[[nodiscard]] Pose2 SampleMotion(const Pose2& T_map_robot, const Pose2& T_prev_curr, const MotionSampling& options,
                                 std::mt19937_64& rng);

}  // namespace cairn::slam
