// The robust loss of loops, that of Cauchy, which reduces the influence of those that contradict the rest.
#pragma once

namespace cairn::slam {

// Half or twice of these changes no error by more than 1 % (study `sensitivity`).
inline constexpr double kLoopLoss = 3.0;  // Standard deviations beyond which the influence of a loop is reduced.
inline constexpr double kLoopLossWidening = 10.0;  // Ratio of the widths of the loss in two of its three steps.

}  // namespace cairn::slam
