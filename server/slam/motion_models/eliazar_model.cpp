#include "server/slam/motion_models/eliazar_model.h"

#include <cmath>
#include <string>

#include "server/slam/random/draws.h"

namespace cairn::slam {
namespace {

// `unit` is the unit of the term, m or rad.
void VisitTerm(OptionVisitor& visitor, MotionTermModel& term, const std::string& unit) {
  const std::string per_m = unit + "/m", per_rad = unit + "/rad";
  visitor.Real("mean_d", term.mean_d, per_m, -10.0, 10.0, "Mean per metre that the odometry reports.");
  visitor.Real("mean_b", term.mean_b, per_rad, -10.0, 10.0, "Mean per radian that the odometry reports.");
  visitor.Real("sigma_d", term.sigma_d, per_m, 0.0, 10.0, "Standard deviation per metre that the odometry reports.");
  visitor.Real("sigma_b", term.sigma_b, per_rad, 0.0, 10.0, "Standard deviation per radian that the odometry reports.");
  visitor.Real("floor", term.floor, unit, 1e-6, 1.0, "Standard deviation after a step without motion.");
}

}  // namespace

void Visit(OptionVisitor& visitor, EliazarModel& model) {
  visitor.Section("along", "D: the way along the heading that the robot has half-way through the turn.",
                  [&] { VisitTerm(visitor, model.along, "m"); });
  visitor.Section("across", "C: the way to the side of that heading.", [&] { VisitTerm(visitor, model.across, "m"); });
  visitor.Section("turn", "B: the turn.", [&] { VisitTerm(visitor, model.turn, "rad"); });
}

Eigen::Vector3d TermsOf(const Pose2& T_prev_curr) {
  const double c = std::cos(T_prev_curr.theta / 2), s = std::sin(T_prev_curr.theta / 2);
  return {c * T_prev_curr.x + s * T_prev_curr.y, -s * T_prev_curr.x + c * T_prev_curr.y, T_prev_curr.theta};
}

Pose2 MotionOf(const Eigen::Vector3d& terms) {
  // The minor axis of (4.46) uses cos((B + pi)/2) = -sin(B/2).
  const double c = std::cos(terms(2) / 2), s = std::sin(terms(2) / 2);
  return {c * terms(0) - s * terms(1), s * terms(0) + c * terms(1), WrapAngle(terms(2))};
}

OdometryStep StepOf(const Pose2& T_prev_curr_odom) {
  const Eigen::Vector3d terms = TermsOf(T_prev_curr_odom);
  return {terms(0), terms(2)};
}

Pose2 MeanMotion(const EliazarModel& model, const OdometryStep& step) {
  return MotionOf(
      {model.along.Mean(step.d, step.b), model.across.Mean(step.d, step.b), model.turn.Mean(step.d, step.b)});
}

Pose2 SampleMotion(const EliazarModel& model, const OdometryStep& step, std::mt19937_64& engine) {
  Eigen::Vector3d terms;
  for (int i = 0; i < kMotionTerms; ++i) {
    const MotionTermModel& term = model.term(i);
    terms(i) = term.Mean(step.d, step.b) + std::sqrt(term.Variance(step.d, step.b)) * NormalDraw(engine);
  }
  return MotionOf(terms);
}

double LogDensity(const EliazarModel& model, const OdometryStep& step, const Eigen::Vector3d& terms) {
  double sum = 0.0;
  for (int i = 0; i < kMotionTerms; ++i) {
    const MotionTermModel& term = model.term(i);
    const double variance = term.Variance(step.d, step.b), mean = term.Mean(step.d, step.b);
    const double error = i == 2 ? AngleDiff(terms(i), mean) : terms(i) - mean;
    sum -= 0.5 * (error * error / variance + std::log(2 * kPi * variance));
  }
  return sum;
}

}  // namespace cairn::slam
