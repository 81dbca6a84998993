// The three ways in which makers of laser scanners state a range's random error, and draws from them.
// "+-e" is taken as a bound that no error exceeds, with all errors within it equally likely, because the makers state
// no more than that. Source: thesis C 4.3.3.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "client/sim/random.h"
#include "common/status.h"

namespace cairn::sim {

enum class RangeErrorKind : std::uint8_t {
  kSigma = 0,  // Normal, standard deviation sigma_m + sigma_share * range.
  kPercent,    // Within +-(bound_m + bound_share * range): a fixed number or a percentage, the other being 0.
  kStep,       // Within +-bound_m up to step_m, within +-bound_share * range beyond.
};
// In the order of the enum: sigma, percent, step.
[[nodiscard]] std::span<const std::string_view> RangeErrorNames();

struct RangeError {
  RangeErrorKind kind = RangeErrorKind::kSigma;
  double sigma_m = 0.01;
  double sigma_share = 0.001;  // Added per metre of range.
  double bound_m = 0.01;
  double bound_share = 0.01;
  double step_m = 1.0;
};
[[nodiscard]] Result<void> Validate(const RangeError& error);

// The half-width of what a draw may be, or its standard deviation for kSigma.
[[nodiscard]] double ErrorScale(const RangeError& error, double range_m);
[[nodiscard]] double DrawError(const RangeError& error, double range_m, Random& random);

}  // namespace cairn::sim
