#include "server/slam/matchers/line_lsq.h"

#include <algorithm>

#include "server/slam/matching/match_covariance.h"
#include "server/slam/matching/match_result.h"

namespace cairn::slam {
namespace {

std::vector<WeightedPair> WeightedPairs(std::span<const LineFeature> ref, std::span<const LineFeature> curr,
                                        std::span<const LinePair> pairs) {
  std::vector<WeightedPair> weighted;
  weighted.reserve(pairs.size());
  for (const LinePair& pair : pairs) {
    const LineFeature& line_ref = ref[static_cast<std::size_t>(pair.ref)];
    const LineFeature& line_curr = curr[static_cast<std::size_t>(pair.curr)];
    weighted.push_back(
        {MidpointAndNormal(line_ref), MidpointAndNormal(line_curr), std::min(line_ref.length, line_curr.length)});
  }
  return weighted;
}

bool SamePairs(std::span<const LinePair> a, std::span<const LinePair> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const LinePair& x, const LinePair& y) { return x.ref == y.ref && x.curr == y.curr; });
}

// Converts the information H of a step applied from the left to the information of (x, y, theta) of
// T_ref_curr.
Eigen::Matrix3d InformationOfPose(const Eigen::Matrix3d& H_step, const Pose2& T_ref_curr) {
  Eigen::Matrix3d J_step_pose = Eigen::Matrix3d::Identity();
  J_step_pose.topRightCorner<2, 1>() << T_ref_curr.y, -T_ref_curr.x;
  return J_step_pose.transpose() * H_step * J_step_pose;
}

double PairedShare(std::span<const LineFeature> curr, std::span<const LinePair> pairs) {
  double paired = 0.0, all = 0.0;
  for (const LineFeature& line : curr) all += line.length;
  for (const LinePair& pair : pairs) paired += curr[static_cast<std::size_t>(pair.curr)].length;
  return all > 0.0 ? paired / all : 0.0;
}

// Covariance from the pairs alone; along a corridor the prior is used afterwards.
Eigen::Matrix3d CovarianceOf(const ScanFeatures& ref, const ScanFeatures& curr, const LineLsqMatch& match) {
  return PairsCovariance(ref, curr, match.pairs, match.result, OdometryCovariance(match.result.T_ref_curr, {}),
                         LineNoiseFloor{});
}

}  // namespace

void Visit(OptionVisitor& visitor, LineLsqOptions& options) {
  visitor.Section("polylines", "Joining lines before they are matched.", [&] { Visit(visitor, options.polylines); });
  visitor.Section("association", "Which lines are the same walls.", [&] { Visit(visitor, options.association); });
  visitor.Section("least_squares", "The motion from the pairs of lines.",
                  [&] { Visit(visitor, options.least_squares); });
  visitor.Integer("max_rounds", options.max_rounds, "1", 1, 1000,
                  "Most rounds of association and least squares. A typical scan needs 8.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0,
               "Share of the length of the lines that must be paired. With less there is no match.");
}

LineLsqMatch MatchLinesByLeastSquares(const ScanFeatures& ref_scan, const ScanFeatures& curr_scan,
                                      const MatchPrior& prior, const LineLsqOptions& options) {
  LineLsqMatch match;
  MatchResult& result = match.result;
  result.T_ref_curr = prior.T_ref_curr;
  result.covariance = prior.covariance;
  const auto fail = [&](MatchFailure failure) {
    match.result = {};
    match.result.T_ref_curr = prior.T_ref_curr;
    match.result.covariance = prior.covariance;
    match.result.failure = failure;
    return match;
  };
  ScanFeatures ref, curr;
  ref.lines = PolylineLines(ref_scan.lines, options.polylines);
  curr.lines = PolylineLines(curr_scan.lines, options.polylines);
  if (ref.lines.empty() || curr.lines.empty()) return fail(MatchFailure::kTooFewFeatures);

  for (int round = 0; round < options.max_rounds; ++round) {
    std::vector<LinePair> pairs = AssociateLines(ref.lines, curr.lines, result.T_ref_curr, round, options.association);
    if (pairs.empty()) return fail(MatchFailure::kNoPairs);
    const bool same = SamePairs(pairs, match.pairs);
    match.pairs = std::move(pairs);
    const LineAlignment alignment =
        AlignLinePairs(WeightedPairs(ref.lines, curr.lines, match.pairs), result.T_ref_curr, options.least_squares);
    match.errors.push_back(alignment.chi.back() / static_cast<double>(match.pairs.size()));
    result.T_ref_curr = alignment.T_ref_curr;
    result.iterations = round + 1;
    DetectDegeneracy(InformationOfPose(alignment.H, result.T_ref_curr), result);
    if (result.degenerate) {
      // Along the wall the midpoints only show where its visible part ends.
      const Eigen::Vector2d t = TakeAlongFromPrior(result.T_ref_curr.translation(), prior.T_ref_curr.translation(),
                                                   result.degenerate_direction);
      result.T_ref_curr = {t.x(), t.y(), result.T_ref_curr.theta};
    }
    if (same && round >= options.association.shrinking_rounds) break;
  }
  result.score = PairedShare(curr.lines, match.pairs);
  if (result.score < options.min_score) return fail(MatchFailure::kInconsistent);
  result.inliers = static_cast<int>(match.pairs.size());
  result.converged = true;
  result.covariance = CovarianceOf(ref, curr, match);
  TakeAlongFromPrior(prior, result);
  return match;
}

MatchResult MatchByLineLsq(const ScanFeatures& ref, const ScanFeatures& curr, const MatchPrior& prior,
                           const LineLsqOptions& options) {
  return MatchLinesByLeastSquares(ref, curr, prior, options).result;
}

}  // namespace cairn::slam
