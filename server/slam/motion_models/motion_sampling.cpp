#include "server/slam/motion_models/motion_sampling.h"

#include <array>
#include <cmath>

#include "server/slam/motion/odometry_model.h"
#include "server/slam/random/draws.h"

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 4> kMotionModelNames = {"velocity", "odometry", "eliazar", "scan_matching"};

double Noise(double alpha_a, double a, double alpha_b, double b, std::mt19937_64& rng) {
  return std::sqrt(alpha_a * a * a + alpha_b * b * b) * NormalDraw(rng);
}

Pose2 SampleVelocity(const Pose2& T_map_robot, const Pose2& T_prev_curr, const MotionSampling& o,
                     std::mt19937_64& rng) {
  VelocityControl c = InverseVelocity(T_prev_curr);
  const double v = c.v, w = c.w;
  c.v += Noise(o.alpha_v_v, v, o.alpha_v_w, T_prev_curr.theta, rng);
  c.w += Noise(o.alpha_w_v, v, o.alpha_w_w, w, rng);
  c.g += Noise(o.alpha_g_v, v, o.alpha_g_w, T_prev_curr.theta, rng);
  return ApplyVelocity(T_map_robot, c);
}

Pose2 SampleOdometry(const Pose2& T_map_robot, const Pose2& T_prev_curr, const MotionSampling& o,
                     std::mt19937_64& rng) {
  OdometryControl c = InverseOdometry(T_prev_curr);
  const OdometryControl mean = c;
  c.rot1 += Noise(o.alpha_w_v, mean.trans, o.alpha_w_w, mean.rot1, rng);
  c.trans += Noise(o.alpha_v_v, mean.trans, o.alpha_v_w, std::hypot(mean.rot1, mean.rot2), rng);
  c.rot2 += Noise(o.alpha_w_v, mean.trans, o.alpha_w_w, mean.rot2, rng);
  return ApplyControl(T_map_robot, c);
}

}  // namespace

VelocityControl InverseVelocity(const Pose2& T_prev_curr) {
  const double chord = T_prev_curr.translation().norm();
  VelocityControl control;
  if (chord < 1e-9) return {0.0, 0.0, T_prev_curr.theta};
  // An arc that leaves along x meets (x, y) after turning by twice the bearing of that point.
  double half = std::atan2(T_prev_curr.y, T_prev_curr.x);
  const bool backwards = std::abs(half) > kPi / 2;
  if (backwards) half = WrapAngle(half + kPi);
  control.w = 2.0 * half;
  control.v = std::abs(half) < 1e-6 ? chord : chord * half / std::sin(half);
  if (backwards) control.v = -control.v;
  control.g = AngleDiff(T_prev_curr.theta, control.w);
  return control;
}

Pose2 ApplyVelocity(const Pose2& T_map_robot, const VelocityControl& control) {
  const double half = 0.5 * control.w;
  const double chord = std::abs(half) < 1e-6 ? control.v : control.v * std::sin(half) / half;
  const double course = T_map_robot.theta + half;  // Lines 4 and 5 by their chord: no division by a small w.
  return {T_map_robot.x + chord * std::cos(course), T_map_robot.y + chord * std::sin(course),
          WrapAngle(T_map_robot.theta + control.w + control.g)};
}

void Visit(OptionVisitor& visitor, MotionModel& model) {
  VisitEnum(visitor, "model", model, kMotionModelNames,
            "How FastSLAM 1.0 draws the motion of a step. eliazar and scan_matching use the models of slam.motion.");
}

void Visit(OptionVisitor& visitor, MotionSampling& options) {
  Visit(visitor, options.model);
  const auto alpha = [&](std::string_view key, double& value, std::string_view help) {
    visitor.Real(key, value, "1", 0.0, 10.0, help);
  };
  alpha("alpha_v_v", options.alpha_v_v, "Variance of the distance per squared distance.");
  alpha("alpha_v_w", options.alpha_v_w, "Variance of the distance per squared turn, in m^2/rad^2.");
  alpha("alpha_w_v", options.alpha_w_v, "Variance of the turn per squared distance, in rad^2/m^2.");
  alpha("alpha_w_w", options.alpha_w_w, "Variance of the turn per squared turn.");
  alpha("alpha_g_v", options.alpha_g_v, "Variance of the final turn per squared distance, in rad^2/m^2.");
  alpha("alpha_g_w", options.alpha_g_w, "Variance of the final turn per squared turn.");
}

StepMotion InputOf(MotionModel model, const StepMotion& step) {
  return model == MotionModel::kEliazar ? step.ByOdometry() : step;
}

Pose2 SampleMotion(const Pose2& T_map_robot, const StepMotion& step, const MotionSampling& options,
                   std::mt19937_64& rng) {
  switch (options.model) {
    case MotionModel::kOdometry:
      return SampleOdometry(T_map_robot, step.T_prev_curr, options, rng);
    case MotionModel::kEliazar:
      return T_map_robot * SampleMotion(options.learnt.eliazar, StepOf(step.T_prev_curr), rng);
    case MotionModel::kScanMatching:
      return T_map_robot * SampleMotion(options.learnt.scan_matching, step.T_prev_curr, step.lambda_m, rng);
    case MotionModel::kVelocity:
      break;
  }
  return SampleVelocity(T_map_robot, step.T_prev_curr, options, rng);
}

}  // namespace cairn::slam
