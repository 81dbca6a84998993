#include "server/slam/random/draws.h"

#include <cmath>

#include "common/geometry/angle.h"

namespace cairn::slam {

double UniformDraw(Rng& rng) {
  return static_cast<double>(rng() >> 11) * 0x1.0p-53;
}

// Box and Muller 1958. The second value of the pair is discarded, so that there is no hidden state.
double NormalDraw(Rng& rng) {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - UniformDraw(rng)));
  return radius * std::cos(2.0 * kPi * UniformDraw(rng));
}

Eigen::Vector3d ThreeNormalDraws(Rng& rng) {
  Eigen::Vector3d draws;
  // The last component is drawn first, which is the order in which gcc evaluates arguments.
  for (int i = 2; i >= 0; --i) draws(i) = NormalDraw(rng);
  return draws;
}

}  // namespace cairn::slam
