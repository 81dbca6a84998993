#include "client/sim/range_error.h"

#include <array>

namespace cairn::sim {

std::span<const std::string_view> RangeErrorNames() {
  static constexpr std::array<std::string_view, 3> kNames = {"sigma", "percent", "step"};
  return kNames;
}

Result<void> Validate(const RangeError& e) {
  const auto metres = [](double value) { return value >= 0.0 && value <= 10.0; };
  const auto share = [](double value) { return value >= 0.0 && value <= 1.0; };
  if (!metres(e.sigma_m) || !metres(e.bound_m) || !share(e.sigma_share) || !share(e.bound_share))
    return Fail(StatusCode::kInvalidArgument, "laser: noise must be 0..10 m and 0..1 per metre");
  if (!(e.step_m >= 0.0 && e.step_m <= 1000.0))
    return Fail(StatusCode::kInvalidArgument, "laser: the error's step must be at 0..1000 m");
  return {};
}

double ErrorScale(const RangeError& error, double range_m) {
  switch (error.kind) {
    case RangeErrorKind::kPercent:
      return error.bound_m + error.bound_share * range_m;
    case RangeErrorKind::kStep:
      return range_m <= error.step_m ? error.bound_m : error.bound_share * range_m;
    case RangeErrorKind::kSigma:
      break;
  }
  return error.sigma_m + error.sigma_share * range_m;
}

double DrawError(const RangeError& error, double range_m, Random& random) {
  const double scale = ErrorScale(error, range_m);
  if (error.kind == RangeErrorKind::kSigma) return Normal(random, scale);
  return scale > 0.0 ? Uniform(random) * (2.0 * scale) - scale : 0.0;
}

}  // namespace cairn::sim
