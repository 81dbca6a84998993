// Central differences: the oracle every hand-written Jacobian is checked against.
#pragma once

#include <Eigen/Core>

namespace cairn {

// d(f)/d(x) at x, column by column. `f` maps an Eigen vector to an Eigen vector; where it answers angles they must not
// wrap within `step` of x.
template <int Outputs, int Inputs, typename Function>
Eigen::Matrix<double, Outputs, Inputs> NumericalDerivative(const Function& f, const Eigen::Matrix<double, Inputs, 1>& x,
                                                           double step = 1e-6) {
  Eigen::Matrix<double, Outputs, Inputs> J;
  for (int i = 0; i < Inputs; ++i) {
    Eigen::Matrix<double, Inputs, 1> ahead = x, behind = x;
    ahead(i) += step;
    behind(i) -= step;
    const Eigen::Matrix<double, Outputs, 1> difference = f(ahead) - f(behind);
    J.col(i) = difference / (2.0 * step);
  }
  return J;
}

}  // namespace cairn
