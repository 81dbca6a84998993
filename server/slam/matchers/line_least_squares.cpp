#include "server/slam/matchers/line_least_squares.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

// Normal equations (4.14), (4.15) at one transform.
struct System {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double chi = 0.0;
};

System Linearise(std::span<const WeightedPair> pairs, const Pose2& T, double along_weight,
                 const LineLeastSquaresOptions& options) {
  System sum;
  for (const WeightedPair& pair : pairs) {
    const PointNormal moved = Transform(T, pair.curr);
    const Eigen::Vector4d e = LineError(moved, pair.ref);
    const Eigen::Matrix<double, 4, 3> J = J_error_step(moved);
    const double length = std::max(pair.length, 0.05);
    const Eigen::Matrix4d omega = std::pow(length, options.length_power) *
                                  LineInformation(pair.ref.n, along_weight, options.normal_weight * length * length);
    sum.H.noalias() += J.transpose() * omega * J;
    sum.b.noalias() += J.transpose() * omega * e;
    sum.chi += e.dot(omega * e);
  }
  return sum;
}

}  // namespace

void Visit(OptionVisitor& visitor, LineLeastSquaresOptions& options) {
  visitor.Real(
      "along_weight", options.along_weight, "1", 1e-9, 1.0,
      "Weight of the distance between midpoints along the wall (epsilon). A larger value is more often wrong, because "
      "other parts of a wall are visible from elsewhere; 0 would leave a corridor without a solution.");
  visitor.Real("normal_weight", options.normal_weight, "1", 1e-6, 100.0,
               "Weight of the slopes relative to the places (alpha).");
  visitor.Real("length_power", options.length_power, "1", 0.0, 4.0,
               "Power of the length in the weight of a pair. 0 gives all pairs the same weight, as the thesis does.");
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 1000,
                  "Most iterations. A typical one needs 4; the thesis runs 100.");
}

PointNormal MidpointAndNormal(const LineFeature& line) {
  return {line.midpoint(), line.left_normal()};
}

PointNormal Transform(const Pose2& T, const PointNormal& line) {
  return {T * line.p, T.rotation() * line.n};
}

Eigen::Vector4d LineError(const PointNormal& moved, const PointNormal& ref) {
  Eigen::Vector4d e;
  e << moved.p - ref.p, moved.n - ref.n;
  return e;
}

Eigen::Matrix<double, 4, 3> J_error_step(const PointNormal& moved) {
  Eigen::Matrix<double, 4, 3> J = Eigen::Matrix<double, 4, 3>::Zero();
  J.topLeftCorner<2, 2>().setIdentity();
  J.topRightCorner<2, 1>() << -moved.p.y(), moved.p.x();
  J.bottomRightCorner<2, 1>() << -moved.n.y(), moved.n.x();
  return J;
}

Eigen::Matrix4d LineInformation(const Eigen::Vector2d& normal_ref, double along_weight, double normal_weight) {
  Eigen::Matrix2d R;
  R << normal_ref.x(), -normal_ref.y(), normal_ref.y(), normal_ref.x();
  Eigen::Matrix4d omega = Eigen::Matrix4d::Zero();
  omega.topLeftCorner<2, 2>() = R * Eigen::Vector2d(1.0, along_weight).asDiagonal() * R.transpose();
  omega.bottomRightCorner<2, 2>() = normal_weight * Eigen::Matrix2d::Identity();
  return omega;
}

LineAlignment AlignLinePairs(std::span<const WeightedPair> pairs, const Pose2& T_ref_curr_start,
                             const LineLeastSquaresOptions& options) {
  LineAlignment answer;
  answer.T_ref_curr = T_ref_curr_start;
  if (pairs.empty()) return answer;
  for (int iteration = 0; iteration < options.max_iterations && !answer.converged; ++iteration) {
    const System sum = Linearise(pairs, answer.T_ref_curr, options.along_weight, options);
    answer.chi.push_back(sum.chi);
    const Eigen::Vector3d step = -sum.H.ldlt().solve(sum.b);
    if (!step.allFinite()) return answer;
    answer.T_ref_curr = Pose2{step.x(), step.y(), WrapAngle(step.z())} * answer.T_ref_curr;  // (4.17)
    answer.converged = step.norm() < options.stop_step;
  }
  answer.chi.push_back(Linearise(pairs, answer.T_ref_curr, options.along_weight, options).chi);
  answer.H = Linearise(pairs, answer.T_ref_curr, 0.0, options).H;
  return answer;
}

}  // namespace cairn::slam
