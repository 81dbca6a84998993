#include "server/slam/matching/point_to_line.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/geometry/pose_difference.h"
#include "server/slam/matching/match_result.h"

namespace cairn::slam {
namespace {

// The iteration stops when a step turns by less than this and is shorter than stop_step_m. Half or twice the value
// changes the errors no more than another seed (study `sensitivity`).
constexpr double kStopStepRad = 2e-4;
// Where most points are outliers, the derivatives of their weighted distances add up to nothing.
constexpr double kLeastSlope = 0.2;

// The lower triangle of the sum of weight * J * J', which is all that the solver reads.
class InformationSum {
 public:
  void Add(double weight, const Eigen::Vector3d& J) {
    const double y = weight * J.y(), turn = weight * J.z();
    xx_ += weight * J.x() * J.x();
    yx_ += y * J.x();
    yy_ += y * J.y();
    tx_ += turn * J.x();
    ty_ += turn * J.y();
    tt_ += turn * J.z();
  }
  [[nodiscard]] Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d H;
    H << xx_, yx_, tx_, yx_, yy_, ty_, tx_, ty_, tt_;
    return H;
  }

 private:
  double xx_ = 0.0, yx_ = 0.0, yy_ = 0.0, tx_ = 0.0, ty_ = 0.0, tt_ = 0.0;
};

// Normal equations of the linearised point-to-line errors at one pose, and the numbers of pairs and inliers.
struct Linearisation {
  InformationSum H;
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  int pairs = 0;
  int inliers = 0;
};

// What is only asked for at the result.
struct AtTheEnd {
  Eigen::Matrix3d H_surfaces = Eigen::Matrix3d::Zero();  // H from only the pairs whose reference point has a direction.
  // Sums over the pairs: of the weights, of the squares of the weighted distances, and of the derivatives of these.
  double weights = 0.0, squares = 0.0, derivatives = 0.0;

  // `relative` is the distance as a share of the scale of the Cauchy loss.
  void AddPair(double weight, double residual, double relative) {
    weights += weight;
    squares += weight * weight * residual * residual;
    derivatives += weight * (1.0 - relative * relative) / (1.0 + relative * relative);
  }
  // The factor by which the inverse of H becomes the covariance of the result, in m^2: without outliers, the variance
  // of the distances. Source: Huber, Ronchetti, Robust Statistics, 2009, (7.81).
  [[nodiscard]] double Variance() const {
    const double slope = std::max(derivatives, kLeastSlope * weights);
    return weights > 0.0 ? squares * weights / (slope * slope) : 0.0;
  }
};

// `found` has for each point what PointIndex::Nearest left there at the pose before. If `end` is not null, the pairs
// are added to its sums.
Linearisation Linearise(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                        const Pose2& T_ref_robot, double gate_m, const PointToLineOptions& options,
                        std::span<PointIndex::Found> found, AtTheEnd* end = nullptr) {
  Linearisation sum;
  const double c = std::cos(T_ref_robot.theta), s = std::sin(T_ref_robot.theta);
  const double scale = std::max(options.residual_sigma_m, options.cauchy_share * gate_m);
  std::int32_t neighbour = PointIndex::kNone;  // The surface of the point before is often that of this one as well.
  for (std::size_t i = 0; i < points_robot.size(); ++i) {
    const SurfacePoint& point = points_robot[i];
    const Eigen::Vector2d turned(c * point.p.x() - s * point.p.y(), s * point.p.x() + c * point.p.y());
    const Eigen::Vector2d p_ref = turned + T_ref_robot.translation();
    if (found[i].clear_m == 0.0) found[i].point = neighbour;
    const SurfacePoint* nearest = reference.Nearest(p_ref, gate_m, found[i]);
    if (nearest == nullptr) continue;
    neighbour = found[i].point;
    const Eigen::Vector2d offset = p_ref - nearest->p;
    Eigen::Vector2d normal = nearest->normal;
    double trust = 1.0;
    const bool directed = nearest->smooth();
    if (directed && point.smooth()) {
      // The two sides of a thin wall are different surfaces, so their points are not paired.
      const Eigen::Vector2d own(c * point.normal.x() - s * point.normal.y(),
                                s * point.normal.x() + c * point.normal.y());
      if (own.dot(normal) < options.same_side) continue;
    } else if (!directed) {
      // A reference point without a surface direction constrains only the distance to it.
      const double distance = offset.norm();
      if (distance < 1e-6) continue;
      normal = offset / distance;
      trust = options.rough_trust;
    }
    const double residual = normal.dot(offset);
    // Weight of the Cauchy loss.
    const double weight = trust / (1.0 + (residual / scale) * (residual / scale));
    const Eigen::Vector3d J(normal.x(), normal.y(), normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
    sum.H.Add(weight, J);
    if (end != nullptr) {
      if (directed) end->H_surfaces.noalias() += weight * J * J.transpose();
      end->AddPair(weight, residual, residual / scale);
    }
    sum.g.noalias() += weight * residual * J;
    ++sum.pairs;
    if (std::abs(residual) < options.inlier_distance_m) ++sum.inliers;
  }
  return sum;
}

}  // namespace

SurfaceAgreement CompareSurfaces(std::span<const SurfacePoint> points_curr, const PointIndex& reference,
                                 const Pose2& T_ref_curr, double distance_m) {
  SurfaceAgreement sum;
  const Eigen::Matrix2d R = T_ref_curr.rotation();
  double squares = 0.0;
  PointIndex::Found neighbour;
  for (const SurfacePoint& point : points_curr) {
    const Eigen::Vector2d turned = R * point.p, p_ref = turned + T_ref_curr.translation();
    const SurfacePoint* nearest = reference.Nearest(p_ref, distance_m, neighbour);
    if (nearest == nullptr) continue;
    const bool directed = nearest->smooth() && point.smooth();
    // The point lies on the other side of a thin wall.
    if (directed && nearest->normal.dot(R * point.normal) < 0.5) continue;
    ++sum.inliers;
    const Eigen::Vector2d offset = p_ref - nearest->p;
    const double across = nearest->smooth() ? nearest->normal.dot(offset) : offset.norm();
    squares += across * across;
    if (!directed) continue;
    const Eigen::Vector3d J(nearest->normal.x(), nearest->normal.y(),
                            nearest->normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
    sum.H.noalias() += J * J.transpose();
  }
  if (sum.inliers == 0) return sum;
  sum.score = static_cast<double>(sum.inliers) / static_cast<double>(points_curr.size());
  sum.rms_m = std::sqrt(squares / sum.inliers);
  return sum;
}

void Visit(OptionVisitor& visitor, PointToLineOptions& options) {
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 200,
                  "Most iterations. A typical scan needs fewer than 8.");
  visitor.Real("first_pair_distance_m", options.first_pair_distance_m, "m", 0.05, 2.0,
               "Largest distance between a point and its surface at first. A larger value tolerates worse guesses, and "
               "accepts more wrong pairs.");
  visitor.Real("last_pair_distance_m", options.last_pair_distance_m, "m", 0.02, 2.0,
               "Largest distance between a point and its surface in the last iterations.");
  visitor.Real("residual_sigma_m", options.residual_sigma_m, "m", 0.001, 1.0,
               "Standard deviation of the distance of a point from its surface. With a smaller value the scan counts "
               "more against the prior.");
  visitor.Real("stop_step_m", options.stop_step_m, "m", 1e-7, 0.1,
               "The iteration stops when a step is shorter than this and turns by less than 0.0002 rad.");
  visitor.Real("inlier_distance_m", options.inlier_distance_m, "m", 0.01, 1.0,
               "A point that is nearer to its surface counts as explained.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0,
               "Share of the points that must be explained for a match. With 0.7 the smoothed error on intel is 5.7 "
               "times as large.");
  visitor.Real("rough_trust", options.rough_trust, "1", 0.0, 1.0,
               "Weight of a pair whose reference point has no surface direction. With half the value the error in a "
               "simulated corridor is an eighth, and the walls of the map of duke-loop5 are 1.5 times as thick.");
  visitor.Real(
      "same_side", options.same_side, "1", -1.0, 1.0,
      "Cosine between the directions of two surface points below which they lie on two sides of a wall and are "
      "not paired. With half the value the error in the corridor of the log furo is 1.5 times as "
      "large.");
  visitor.Real(
      "cauchy_share", options.cauchy_share, "1", 0.0, 10.0,
      "Scale of the Cauchy weights as a share of the largest pair distance, at least residual_sigma_m. With half "
      "the value the walls of the map of duke-loop5 are 0.4 times as thick, and the online error on mit-csail is 1.1 "
      "times as large, which another seed can cause as well.");
  visitor.Integer("shrink_iterations", options.shrink_iterations, "1", 1, 200,
                  "Iterations over which the largest pair distance shrinks from the first to the last. With half "
                  "or twice the value the walls of the map of duke-loop5 are a fifth thinner.");
  visitor.Require(options.last_pair_distance_m <= options.first_pair_distance_m, "last_pair_distance_m",
                  "must not exceed", "first_pair_distance_m");
}

MatchResult AlignPointsToSurfaces(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                                  const AlignmentGuess& guess, const PointToLineOptions& options) {
  MatchResult result;
  result.T_ref_curr = guess.T_ref_robot_prior;
  result.covariance = guess.prior_covariance;
  if (points_robot.size() < 5 || reference.size() < 5) {
    result.failure = MatchFailure::kTooFewFeatures;
    return result;
  }
  const Eigen::Matrix3d prior_information = guess.prior_covariance.llt().solve(Eigen::Matrix3d::Identity());
  const double per_point = 1.0 / (options.residual_sigma_m * options.residual_sigma_m);
  const double least_inliers = guess.least_score * static_cast<double>(points_robot.size());
  std::vector<PointIndex::Found> found(points_robot.size());
  Pose2 T = guess.T_ref_robot_start;
  Linearisation sum;
  bool settled = false;
  for (int iteration = 0; iteration < options.max_iterations && !settled; ++iteration) {
    const double shrink = std::min(1.0, iteration / static_cast<double>(options.shrink_iterations));
    const double gate =
        options.first_pair_distance_m + shrink * (options.last_pair_distance_m - options.first_pair_distance_m);
    sum = Linearise(points_robot, reference, T, gate, options, found);
    if (sum.pairs < 5) break;
    if (iteration >= guess.settling && sum.inliers < least_inliers) {
      result.failure = MatchFailure::kNotConverged;
      return result;
    }
    const Eigen::Vector3d from_prior = Minus(T, guess.T_ref_robot_prior);
    const Eigen::Matrix3d H = per_point * sum.H.matrix() + prior_information;
    const Eigen::Vector3d step = -H.ldlt().solve(per_point * sum.g + prior_information * from_prior);
    if (!step.allFinite()) {
      result.failure = MatchFailure::kNotConverged;
      return result;
    }
    T = Plus(T, step);
    result.iterations = iteration + 1;
    settled = shrink >= 1.0 && step.head<2>().norm() < options.stop_step_m && std::abs(step.z()) < kStopStepRad;
  }
  AtTheEnd end;
  sum = Linearise(points_robot, reference, T, options.last_pair_distance_m, options, found, &end);
  result.inliers = sum.inliers;
  result.score = static_cast<double>(sum.inliers) / static_cast<double>(points_robot.size());
  if (result.score < options.min_score || sum.pairs < 5) {
    result.failure = MatchFailure::kNotConverged;
    return result;
  }
  result.T_ref_curr = T;
  result.converged = true;
  result.covariance = (per_point * sum.H.matrix() + prior_information).llt().solve(Eigen::Matrix3d::Identity());
  result.covariance = 0.5 * (result.covariance + result.covariance.transpose()).eval();
  // A reference point without a surface direction seems to constrain all directions, so only surfaces are
  // used to judge degeneracy.
  const Eigen::Matrix3d& shown = end.H_surfaces;
  DetectDegeneracy(per_point * shown, result);
  result.surface_information =
      per_point * (shown.topLeftCorner<2, 2>() -
                   shown.topRightCorner<2, 1>() * shown.bottomLeftCorner<1, 2>() / std::max(shown(2, 2), 1e-12));
  result.shown_covariance = end.Variance() * per_point * result.covariance;
  return result;
}

}  // namespace cairn::slam
