#include "server/slam/motion_models/scan_matching_model.h"

#include <cmath>

#include "server/slam/random/draws.h"

namespace cairn::slam {

bool MayFallShort(const ScanMatchingModel& model, const Pose2& reported, double lambda_m) {
  return lambda_m > 0.0 && std::abs(reported.theta) < model.shortfall_max_turn_rad;
}

double MatchSpread::Sigma(double reported) const {
  return base + share * std::abs(reported);
}

void Visit(OptionVisitor& visitor, ScanMatchingModel& model) {
  const auto spread = [&](std::string_view key, MatchSpread& axis, std::string_view unit) {
    visitor.Section(key, "Error of the matcher on this axis.", [&] {
      visitor.Real("base", axis.base, unit, 1e-6, 1.0, "Standard deviation after a step without motion.");
      visitor.Real("share", axis.share, "1", 0.0, 2.0,
                   "Standard deviation as a share of the reported motion on this axis.");
    });
  };
  spread("along", model.along, "m");
  spread("across", model.across, "m");
  spread("turn", model.turn, "rad");
  visitor.Real("shortfall_share", model.shortfall_share, "1", 0.0, 1.0,
               "Probability that the matcher reports too short a way in a step.");
  visitor.Real("shortfall_max_turn_rad", model.shortfall_max_turn_rad, "rad", 0.0, 3.2,
               "A step with a larger reported turn is never taken for too short.");
}

Pose2 SampleMotion(const ScanMatchingModel& model, const Pose2& T_prev_curr, double lambda_m, std::mt19937_64& engine) {
  // Each call takes the same number of random numbers, whatever their values are.
  const bool is_short = UniformDraw(engine) < model.shortfall_share && MayFallShort(model, T_prev_curr, lambda_m);
  const double forward = NormalDraw(engine), sideways = NormalDraw(engine), turning = NormalDraw(engine);
  return {T_prev_curr.x + (is_short ? lambda_m + lambda_m / 2 * forward : model.along.Sigma(T_prev_curr.x) * forward),
          T_prev_curr.y + model.across.Sigma(T_prev_curr.y) * sideways,
          WrapAngle(T_prev_curr.theta + model.turn.Sigma(T_prev_curr.theta) * turning)};
}

}  // namespace cairn::slam
