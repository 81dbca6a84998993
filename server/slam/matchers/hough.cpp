#include "server/slam/matchers/hough.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/geometry/pose_difference.h"
#include "server/slam/matchers/hough_transform.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"

namespace cairn::slam {
namespace {

// Standard deviation of a result: about the size of the bins, 0.05 m and 0.5 degrees.
constexpr double kSigmaM = 0.03, kSigmaRad = 0.006;

// One equation of (2.15): normal . T = shift, weighted by the height of the correlation's peak.
struct ShiftConstraint {
  Eigen::Vector2d normal;
  double shift = 0.0;
  double weight = 0.0;
};

struct TurnHypothesis {
  Pose2 T_ref_curr;
  SurfaceAgreement agreement;
  double rank = -1.0;  // Explained share of the points minus the penalty of the prior.
  bool found = false;
};

class HoughMatch {
 public:
  HoughMatch(const ScanView& ref, const ScanView& curr, const MatchPrior& prior, const HoughOptions& options)
      : curr_points_(curr.points_robot),
        prior_(prior),
        options_(options),
        ref_(ref.points_robot, static_cast<int>(options.directions), options.rho_step_m, options.max_range_m),
        curr_(curr.points_robot, static_cast<int>(options.directions), options.rho_step_m, options.max_range_m),
        reference_(ref.points_robot) {
    prior_information_ = prior.covariance.llt().solve(Eigen::Matrix3d::Identity());
    directions_ = PeaksOf(curr_.spectrum(), true, static_cast<int>(options.shift_directions), 0.02);
  }

  [[nodiscard]] std::vector<double> Turns() const;
  [[nodiscard]] TurnHypothesis BestShift(double turn) const;

 private:
  [[nodiscard]] std::vector<ShiftConstraint> Constraints(double turn) const;
  [[nodiscard]] Pose2 Combine(std::span<const ShiftConstraint> constraints, const ShiftConstraint& a,
                              const ShiftConstraint* b, double turn) const;
  void Consider(const Pose2& T, TurnHypothesis& best) const;
  [[nodiscard]] double PriorLoss(const Pose2& T) const;

  const std::vector<SurfacePoint>& curr_points_;
  const MatchPrior& prior_;
  const HoughOptions& options_;
  HoughTransform ref_, curr_;
  PointIndex reference_;
  Eigen::Matrix3d prior_information_;
  std::vector<Peak> directions_;  // Directions of the walls in the current scan, in bins (2.16).
};

// Hypotheses of the turn (2.13). Spectra repeat after half a turn, so each peak gives two hypotheses.
std::vector<double> HoughMatch::Turns() const {
  std::vector<double> turns;
  const double step = kPi / static_cast<double>(options_.directions);
  for (const Peak& peak :
       PeaksOf(CorrelateSpectra(ref_, curr_), true, static_cast<int>(options_.turn_hypotheses), 0.1)) {
    for (const double half : {0.0, kPi}) {
      const double turn = WrapAngle(peak.place * step + half);
      if (std::abs(AngleDiff(turn, prior_.T_ref_curr.theta)) <= options_.max_rotation_rad) turns.push_back(turn);
    }
  }
  return turns;
}

// Peaks of the correlated columns along every direction in which the current scan has walls.
std::vector<ShiftConstraint> HoughMatch::Constraints(double turn) const {
  const double step = kPi / static_cast<double>(options_.directions);
  const int turn_bins = static_cast<int>(std::lround(turn / step));
  const int reach = static_cast<int>(std::ceil(options_.max_translation_m / options_.rho_step_m));
  std::vector<ShiftConstraint> constraints;
  for (const Peak& wall : directions_) {
    const int direction = static_cast<int>(std::lround(wall.place)) + turn_bins;
    const Eigen::Vector2d normal(std::cos(direction * step), std::sin(direction * step));
    const int centre = static_cast<int>(std::lround(normal.dot(prior_.T_ref_curr.translation()) / options_.rho_step_m));
    for (const Peak& peak : PeaksOf(CorrelateColumns(ref_, curr_, direction, turn_bins, centre, reach), false,
                                    static_cast<int>(options_.shift_hypotheses), 0.3)) {
      constraints.push_back({normal, (peak.place - reach + centre) * options_.rho_step_m, peak.height});
    }
  }
  return constraints;
}

// The shift from two constraints, then least squares over all constraints that agree with it within a bin
// (2.15). Directions that the constraints leave open are taken from the prior.
Pose2 HoughMatch::Combine(std::span<const ShiftConstraint> constraints, const ShiftConstraint& a,
                          const ShiftConstraint* b, double turn) const {
  const Eigen::Vector2d prior = prior_.T_ref_curr.translation();
  Eigen::Vector2d t = prior + (a.shift - a.normal.dot(prior)) * a.normal;
  if (b != nullptr) {
    Eigen::Matrix2d N;
    N << a.normal.transpose(), b->normal.transpose();
    t = N.inverse() * Eigen::Vector2d(a.shift, b->shift);
  }
  Eigen::Matrix2d H = Eigen::Matrix2d::Zero();
  Eigen::Vector2d g = Eigen::Vector2d::Zero();
  double total = 0.0;
  for (const ShiftConstraint& c : constraints) {
    const double off = c.shift - c.normal.dot(t);
    if (std::abs(off) > options_.rho_step_m) continue;
    H += c.weight * c.normal * c.normal.transpose();
    g += c.weight * off * c.normal;
    total += c.weight;
  }
  // Directions that no constraint measures do not move.
  H.diagonal().array() += 1e-3 * std::max(total, 1e-9);
  t += H.ldlt().solve(g);
  return {t.x(), t.y(), turn};
}

double HoughMatch::PriorLoss(const Pose2& T) const {
  const Eigen::Vector3d away = Minus(T, prior_.T_ref_curr);
  return options_.prior_weight * (1.0 - std::exp(-0.5 * away.dot(prior_information_ * away)));
}

void HoughMatch::Consider(const Pose2& T, TurnHypothesis& best) const {
  if ((T.translation() - prior_.T_ref_curr.translation()).norm() > 1.5 * options_.max_translation_m) return;
  const SurfaceAgreement agreement = CompareSurfaces(curr_points_, reference_, T, options_.inlier_distance_m);
  // Among hypotheses that explain the same share of the points, the one with the smaller residual ranks
  // higher.
  const double rank = agreement.score * (1.0 - 0.3 * agreement.rms_m / options_.inlier_distance_m) - PriorLoss(T);
  if (!best.found || rank > best.rank) best = {T, agreement, rank, true};
}

TurnHypothesis HoughMatch::BestShift(double turn) const {
  const std::vector<ShiftConstraint> constraints = Constraints(turn);
  TurnHypothesis best;
  bool crossing = false;
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    for (std::size_t j = i + 1; j < constraints.size(); ++j) {
      const Eigen::Vector2d &u = constraints[i].normal, &v = constraints[j].normal;
      if (std::abs(u.x() * v.y() - u.y() * v.x()) < std::sin(Radians(30.0))) continue;
      crossing = true;
      Consider(Combine(constraints, constraints[i], &constraints[j], turn), best);
    }
  }
  for (std::size_t i = 0; !crossing && i < constraints.size(); ++i)
    Consider(Combine(constraints, constraints[i], nullptr, turn), best);
  return best;
}

MatchResult Failed(const MatchPrior& prior, MatchFailure failure) {
  MatchResult result;
  result.T_ref_curr = prior.T_ref_curr;
  result.covariance = prior.covariance;
  result.failure = failure;
  return result;
}

}  // namespace

void Visit(OptionVisitor& visitor, HoughOptions& options) {
  visitor.Integer(
      "directions", options.directions, "1", 36, 3600,
      "Number of directions in half a turn. More give more accurate turns and take proportionally more time.");
  visitor.Real("rho_step_m", options.rho_step_m, "m", 0.005, 1.0,
               "Bin width of the distance. Smaller bins give more accurate shifts and need denser points.");
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 100.0, "Points farther away are not used.");
  visitor.Real("max_rotation_rad", options.max_rotation_rad, "rad", 0.0, kPi,
               "Turns of up to this are searched to either side of the prior.");
  visitor.Real("max_translation_m", options.max_translation_m, "m", 0.05, 20.0,
               "Shifts of up to this are searched to either side of the prior.");
  visitor.Integer("turn_hypotheses", options.turn_hypotheses, "1", 1, 100,
                  "Number of turns that are tried: the highest peaks of the correlation of the spectra.");
  visitor.Integer("shift_directions", options.shift_directions, "1", 2, 100,
                  "Number of directions in which the shift is measured.");
  visitor.Integer("shift_hypotheses", options.shift_hypotheses, "1", 1, 20,
                  "Number of shifts that are tried in each direction.");
  visitor.Real("inlier_distance_m", options.inlier_distance_m, "m", 0.01, 1.0,
               "A point that is nearer to a surface counts as explained.");
  visitor.Real("prior_weight", options.prior_weight, "1", 0.0, 1.0,
               "Largest part of the score that an answer far from the prior loses.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0,
               "Share of the points that must be explained. With fewer there is no match.");
}

MatchResult MatchByHough(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                         const HoughOptions& options, const ParallelFor& parallel_for) {
  if (ref.points_robot.size() < 5 || curr.points_robot.size() < 5) return Failed(prior, MatchFailure::kTooFewFeatures);
  const HoughMatch match(ref, curr, prior, options);
  const std::vector<double> turns = match.Turns();
  std::vector<TurnHypothesis> hypotheses(turns.size());
  parallel_for(static_cast<int>(turns.size()), [&](int begin, int end) {
    for (int i = begin; i < end; ++i)
      hypotheses[static_cast<std::size_t>(i)] = match.BestShift(turns[static_cast<std::size_t>(i)]);
  });
  TurnHypothesis best;
  for (const TurnHypothesis& hypothesis : hypotheses)
    if (hypothesis.found && (!best.found || hypothesis.rank > best.rank)) best = hypothesis;
  if (!best.found) return Failed(prior, MatchFailure::kNoPairs);
  if (best.agreement.score < options.min_score) return Failed(prior, MatchFailure::kInconsistent);

  MatchResult result;
  result.score = best.agreement.score;
  result.inliers = best.agreement.inliers;
  result.iterations = 1;
  result.converged = true;
  DetectDegeneracy(best.agreement.H, result);
  result.T_ref_curr = best.T_ref_curr;
  result.covariance = PoseCovariance(kSigmaM, kSigmaRad);
  TakeAlongFromPrior(prior, result);
  return result;
}

}  // namespace cairn::slam
