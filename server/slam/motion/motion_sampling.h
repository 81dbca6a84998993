// Samples of where a step may have led, as FastSLAM 1.0 needs them: the velocity model (an arc) and the odometry model
// (turn, line, turn), or what was learnt of the robot. Which step each takes: the velocity, the odometry and the scan
// matching model the front-end's, which is thesis C's "scan odometry" (4.2, 4.5.1, Tables 5.1-5.3); Eliazar's model
// odometry's own, for d and b of (4.46) are reported odometry: the match is then left to the weights, and a jump of the
// odometry takes all samples along. Without odometry the front-end's step stands in, as in thesis C 4.5.1.
// A control is the step itself: velocities per step, so the time between keyframes is 1. Stateless, thread-safe.
// Source: thesis C 4.2, Table 4.1, 4.5.1, 5.2, after Thrun et al. 2005, Tables 5.3 and 5.6. Corrected: line 1 of Table
// 4.1 uses alpha 1 twice, and "sample" takes variances of squared velocities, or driving backwards would have negative
// noise.
#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/motion/learnt_motion.h"
#include "server/slam/motion/step_motion.h"

namespace cairn::slam {

enum class MotionModel : std::uint8_t { kVelocity = 0, kOdometry, kEliazar, kScanMatching };

// Variances: of v by v^2 and w^2, of w by v^2 and w^2, of the final turn g by v^2 and w^2. The odometry model uses the
// first for the line (by its length and the turns), the second for both turns (by the length and each turn).
struct MotionSampling {
  MotionModel model = MotionModel::kVelocity;
  double alpha_v_v = 3.2e-4, alpha_v_w = 2.5e-5;
  double alpha_w_v = 1.6e-5, alpha_w_w = 2.5e-5;
  double alpha_g_v = 1.6e-5, alpha_g_w = 2.5e-5;
  LearntMotion learnt{};  // Shown as slam.motion.
};
void Visit(OptionVisitor& visitor, MotionModel& model);       // The key `model`.
void Visit(OptionVisitor& visitor, MotionSampling& options);  // All but `learnt`.

// What of the step the model takes.
[[nodiscard]] StepMotion InputOf(MotionModel model, const StepMotion& step);

// A draw of where the model's own noise leads; `step` as InputOf has it, its covariance is not the model's.
[[nodiscard]] Pose2 SampleMotion(const Pose2& T_map_robot, const StepMotion& step, const MotionSampling& options,
                                 std::mt19937_64& rng);

}  // namespace cairn::slam
