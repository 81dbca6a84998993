// Random draws whose definition is our own, so that every standard library and compiler gives the same
// numbers. The caller owns the engine and passes it in; nothing here has state. Thread rule: one engine is
// used by one thread at a time.
#pragma once

#include <Eigen/Core>
#include <random>

namespace cairn::slam {

using Rng = std::mt19937_64;

// Uniform in [0, 1).
[[nodiscard]] double UniformDraw(Rng& rng);
// Standard normal. Source: Box and Muller 1958.
[[nodiscard]] double NormalDraw(Rng& rng);
// Three independent standard normals, for a pose. Use this instead of a constructor with three draws as its
// arguments: the language does not fix the order in which arguments are evaluated, and gcc and clang choose
// differently.
[[nodiscard]] Eigen::Vector3d ThreeNormalDraws(Rng& rng);

}  // namespace cairn::slam
