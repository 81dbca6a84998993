#include "server/slam/matching/hough.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "server/slam/matching/degeneracy.h"
#include "server/slam/matching/hough_transform.h"
#include "server/slam/matching/surface_agreement.h"

namespace cairn::slam {
namespace {

// One line of (2.15): normal . T = shift, as strong as the correlation's peak.
struct ShiftConstraint {
  Eigen::Vector2d normal;
  double shift = 0.0;
  double weight = 0.0;
};

struct TurnHypothesis {
  Pose2 T_prev_curr;
  SurfaceAgreement agreement;
  double rank = -1.0;  // Explained share less what the prior takes.
  bool found = false;
};

class HoughMatch {
 public:
  HoughMatch(const ScanView& prev, const ScanView& curr, const MatchPrior& prior, const HoughOptions& options)
      : curr_points_(curr.points_robot),
        prior_(prior),
        options_(options),
        prev_(prev.points_robot, static_cast<int>(options.directions), options.rho_step_m, options.max_range_m),
        curr_(curr.points_robot, static_cast<int>(options.directions), options.rho_step_m, options.max_range_m),
        reference_(options.inlier_distance_m) {
    for (const SurfacePoint& point : prev.points_robot) reference_.Add(point);
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
  HoughTransform prev_, curr_;
  PointIndex reference_;
  Eigen::Matrix3d prior_information_;
  std::vector<Peak> directions_;  // Of the current scan's walls, in bins (2.16).
};

// Hypotheses of the turn (2.13). Spectra repeat after half a turn, so each peak stands for two.
std::vector<double> HoughMatch::Turns() const {
  std::vector<double> turns;
  const double step = kPi / static_cast<double>(options_.directions);
  for (const Peak& peak :
       PeaksOf(CorrelateSpectra(prev_, curr_), true, static_cast<int>(options_.turn_hypotheses), 0.1)) {
    for (const double half : {0.0, kPi}) {
      const double turn = WrapAngle(peak.place * step + half);
      if (std::abs(AngleDiff(turn, prior_.T_prev_curr.theta)) <= options_.max_rotation_rad) turns.push_back(turn);
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
    const int centre =
        static_cast<int>(std::lround(normal.dot(prior_.T_prev_curr.translation()) / options_.rho_step_m));
    for (const Peak& peak : PeaksOf(CorrelateColumns(prev_, curr_, direction, turn_bins, centre, reach), false,
                                    static_cast<int>(options_.shift_hypotheses), 0.3)) {
      constraints.push_back({normal, (peak.place - reach + centre) * options_.rho_step_m, peak.height});
    }
  }
  return constraints;
}

// The shift two constraints agree on, then least squares over all that agree with it within a bin (2.15). Along what
// they leave open, the prior.
Pose2 HoughMatch::Combine(std::span<const ShiftConstraint> constraints, const ShiftConstraint& a,
                          const ShiftConstraint* b, double turn) const {
  const Eigen::Vector2d prior = prior_.T_prev_curr.translation();
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
  H.diagonal().array() += 1e-3 * std::max(total, 1e-9);  // Directions nobody measured do not move.
  t += H.ldlt().solve(g);
  return {t.x(), t.y(), turn};
}

double HoughMatch::PriorLoss(const Pose2& T) const {
  Eigen::Vector3d away = T.vector() - prior_.T_prev_curr.vector();
  away.z() = WrapAngle(away.z());
  return options_.prior_weight * (1.0 - std::exp(-0.5 * away.dot(prior_information_ * away)));
}

void HoughMatch::Consider(const Pose2& T, TurnHypothesis& best) const {
  if ((T.translation() - prior_.T_prev_curr.translation()).norm() > 1.5 * options_.max_translation_m) return;
  const SurfaceAgreement agreement = CompareSurfaces(curr_points_, reference_, T, options_.inlier_distance_m);
  // Of answers that explain equally many points, the one that explains them better.
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
  result.T_prev_curr = prior.T_prev_curr;
  result.covariance = prior.covariance;
  result.failure = failure;
  return result;
}

}  // namespace

void Visit(OptionVisitor& visitor, HoughOptions& options) {
  visitor.Integer("directions", options.directions, "1", 36, 3600, "Of half a turn; more: finer turns, more time.");
  visitor.Real("rho_step_m", options.rho_step_m, "m", 0.005, 1.0, "Bin of the distance; smaller: finer shifts.");
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 100.0, "Farther points are left out.");
  visitor.Real("max_rotation_rad", options.max_rotation_rad, "rad", 0.0, kPi, "Turns searched about the prior's.");
  visitor.Real("max_translation_m", options.max_translation_m, "m", 0.05, 20.0, "Shifts searched about the prior's.");
  visitor.Integer("turn_hypotheses", options.turn_hypotheses, "1", 1, 100, "Peaks of the spectra's correlation.");
  visitor.Integer("shift_directions", options.shift_directions, "1", 2, 100, "Directions whose columns are compared.");
  visitor.Integer("shift_hypotheses", options.shift_hypotheses, "1", 1, 20, "Peaks taken of each.");
  visitor.Real("inlier_distance_m", options.inlier_distance_m, "m", 0.01, 1.0, "A nearer point counts as explained.");
  visitor.Real("prior_weight", options.prior_weight, "1", 0.0, 1.0, "What an answer far from the prior loses at most.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Fewer explained points: no answer.");
  visitor.Real("degenerate_ratio", options.degenerate_ratio, "1", 0.0, 1.0,
               "Weakest over strongest hold on translation below which it is a corridor.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.001, 1.0, "Floor of the uncertainty: the bins' share.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.0001, 1.0, "See sigma_m.");
}

MatchResult MatchByHough(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                         const HoughOptions& options, const ParallelFor& parallel_for) {
  if (prev.points_robot.size() < 5 || curr.points_robot.size() < 5) return Failed(prior, MatchFailure::kTooFewFeatures);
  const HoughMatch match(prev, curr, prior, options);
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
  JudgeDegeneracy(best.agreement.H, options.degenerate_ratio, result);
  result.T_prev_curr = best.T_prev_curr;
  result.covariance = Eigen::Vector3d(options.sigma_m * options.sigma_m, options.sigma_m * options.sigma_m,
                                      options.sigma_rad * options.sigma_rad)
                          .asDiagonal();
  TakeAlongFromPrior(prior, result);
  return result;
}

}  // namespace cairn::slam
