#include "server/slam/matching/line_lsq.h"

#include <algorithm>

#include "server/slam/matching/degeneracy.h"
#include "server/slam/matching/match_covariance.h"

namespace cairn::slam {
namespace {

std::vector<WeighedPair> Weigh(std::span<const LineFeature> prev, std::span<const LineFeature> curr,
                               std::span<const LinePair> pairs) {
  std::vector<WeighedPair> weighed;
  weighed.reserve(pairs.size());
  for (const LinePair& pair : pairs) {
    const LineFeature& line_prev = prev[static_cast<std::size_t>(pair.prev)];
    const LineFeature& line_curr = curr[static_cast<std::size_t>(pair.curr)];
    weighed.push_back(
        {MidpointAndNormal(line_prev), MidpointAndNormal(line_curr), std::min(line_prev.length, line_curr.length)});
  }
  return weighed;
}

bool SamePairs(std::span<const LinePair> a, std::span<const LinePair> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const LinePair& x, const LinePair& y) { return x.prev == y.prev && x.curr == y.curr; });
}

// H of a step from the left, as information of (x, y, theta) of T_prev_curr.
Eigen::Matrix3d InformationOfPose(const Eigen::Matrix3d& H_step, const Pose2& T_prev_curr) {
  Eigen::Matrix3d J_step_pose = Eigen::Matrix3d::Identity();
  J_step_pose.topRightCorner<2, 1>() << T_prev_curr.y, -T_prev_curr.x;
  return J_step_pose.transpose() * H_step * J_step_pose;
}

double PairedShare(std::span<const LineFeature> curr, std::span<const LinePair> pairs) {
  double paired = 0.0, all = 0.0;
  for (const LineFeature& line : curr) all += line.length;
  for (const LinePair& pair : pairs) paired += curr[static_cast<std::size_t>(pair.curr)].length;
  return all > 0.0 ? paired / all : 0.0;
}

// Of the pairs alone: along a corridor the prior takes over afterwards.
Eigen::Matrix3d CovarianceOf(const ScanFeatures& prev, const ScanFeatures& curr, const LineLsqMatch& match,
                             const LineLsqOptions& options) {
  VotingOptions floors;
  floors.line_sigma_floor_m = options.sigma_floor_m;
  floors.line_slope_sigma_floor_rad = options.slope_sigma_floor_rad;
  return PairsCovariance(prev, curr, match.pairs, match.result, match.result.T_prev_curr, floors);
}

}  // namespace

void Visit(OptionVisitor& visitor, LineLsqOptions& options) {
  visitor.Section("polylines", "Joining lines before they are matched.", [&] { Visit(visitor, options.polylines); });
  visitor.Section("association", "Which lines are the same walls.", [&] { Visit(visitor, options.association); });
  visitor.Section("least_squares", "The motion from the pairs.", [&] { Visit(visitor, options.least_squares); });
  visitor.Integer("max_rounds", options.max_rounds, "1", 1, 1000, "Of association and least squares; typical: 8.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Less of the scan paired: no answer.");
  visitor.Real("degenerate_ratio", options.degenerate_ratio, "1", 0.0, 1.0,
               "Weakest over strongest hold on translation below which it is a corridor.");
  visitor.Real("sigma_floor_m", options.sigma_floor_m, "m", 1e-5, 1.0, "A line's place is never better known.");
  visitor.Real("slope_sigma_floor_rad", options.slope_sigma_floor_rad, "rad", 1e-5, 1.0, "... nor its slope.");
}

LineLsqMatch MatchLinesByLeastSquares(const ScanFeatures& prev_scan, const ScanFeatures& curr_scan,
                                      const MatchPrior& prior, const LineLsqOptions& options) {
  LineLsqMatch match;
  MatchResult& result = match.result;
  result.T_prev_curr = prior.T_prev_curr;
  result.covariance = prior.covariance;
  const auto fail = [&](MatchFailure failure) {
    match.result = {};
    match.result.T_prev_curr = prior.T_prev_curr;
    match.result.covariance = prior.covariance;
    match.result.failure = failure;
    return match;
  };
  ScanFeatures prev, curr;
  prev.lines = PolylineLines(prev_scan.lines, options.polylines);
  curr.lines = PolylineLines(curr_scan.lines, options.polylines);
  if (prev.lines.empty() || curr.lines.empty()) return fail(MatchFailure::kTooFewFeatures);

  for (int round = 0; round < options.max_rounds; ++round) {
    std::vector<LinePair> pairs =
        AssociateLines(prev.lines, curr.lines, result.T_prev_curr, round, options.association);
    if (pairs.empty()) return fail(MatchFailure::kNoPairs);
    const bool same = SamePairs(pairs, match.pairs);
    match.pairs = std::move(pairs);
    const LineAlignment alignment =
        AlignLinePairs(Weigh(prev.lines, curr.lines, match.pairs), result.T_prev_curr, options.least_squares);
    match.errors.push_back(alignment.chi.back() / static_cast<double>(match.pairs.size()));
    result.T_prev_curr = alignment.T_prev_curr;
    result.iterations = round + 1;
    JudgeDegeneracy(InformationOfPose(alignment.H, result.T_prev_curr), options.degenerate_ratio, result);
    if (result.degenerate) {
      // What the midpoints say along the wall is where its visible part ended.
      const Eigen::Vector2d t = TakeAlongFromPrior(result.T_prev_curr.translation(), prior.T_prev_curr.translation(),
                                                   result.degenerate_direction);
      result.T_prev_curr = {t.x(), t.y(), result.T_prev_curr.theta};
    }
    if (same && round >= options.association.shrinking_rounds) break;
  }
  result.score = PairedShare(curr.lines, match.pairs);
  if (result.score < options.min_score) return fail(MatchFailure::kInconsistent);
  result.inliers = static_cast<int>(match.pairs.size());
  result.converged = true;
  result.covariance = CovarianceOf(prev, curr, match, options);
  TakeAlongFromPrior(prior, result);
  return match;
}

MatchResult MatchByLineLsq(const ScanFeatures& prev, const ScanFeatures& curr, const MatchPrior& prior,
                           const LineLsqOptions& options) {
  return MatchLinesByLeastSquares(prev, curr, prior, options).result;
}

}  // namespace cairn::slam
