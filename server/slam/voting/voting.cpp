#include "server/slam/voting/voting.h"

#include <cmath>

#include "server/slam/matching/match_covariance.h"
#include "server/slam/voting/pair_selection.h"
#include "server/slam/voting/pose_from_pairs.h"

namespace cairn::slam {
namespace {

MatchResult FromOdometry(const Pose2& T_ref_curr_odometry, MatchFailure failure, const VotingOptions& options) {
  MatchResult result;
  result.T_ref_curr = T_ref_curr_odometry;
  result.covariance = OdometryCovariance(T_ref_curr_odometry, options.odometry);
  result.failure = failure;
  return result;
}

// Marks the pairs that agree with the result. Returns their share of the lengths of all selected pairs.
double MarkInliers(const ScanFeatures& ref, const ScanFeatures& curr, const Pose2& T_ref_curr,
                   const PoseOptions& options, std::vector<LinePair>& pairs) {
  double agreeing = 0.0, all = 0.0;
  for (LinePair& pair : pairs) {
    const LineFeature& line_ref = ref.lines[static_cast<std::size_t>(pair.ref)];
    const LineFeature& line_curr = curr.lines[static_cast<std::size_t>(pair.curr)];
    const double turn = AngleDiff(AngleDiff(line_ref.slope, line_curr.slope), T_ref_curr.theta);
    const Eigen::Vector2d between = T_ref_curr * line_curr.midpoint() - line_ref.midpoint();
    const Eigen::Vector2d normal =
        (line_ref.left_normal() + T_ref_curr.rotation() * line_curr.left_normal()).normalized();
    pair.inlier = std::abs(turn) <= options.inlier_rad && std::abs(normal.dot(between)) <= options.inlier_m;
    const double weight = std::sqrt(line_ref.length * line_curr.length);
    all += weight;
    if (pair.inlier) agreeing += weight;
  }
  return all > 0.0 ? agreeing / all : 0.0;
}

double MatchedShare(const ScanFeatures& curr, const std::vector<LinePair>& pairs) {
  double matched = 0.0, all = 0.0;
  for (const LineFeature& line : curr.lines) all += line.length;
  for (const LinePair& pair : pairs) {
    if (pair.inlier) matched += curr.lines[static_cast<std::size_t>(pair.curr)].length;
  }
  return all > 0.0 ? matched / all : 0.0;
}

// The displacement by odometry in ref, corrected for the rotation that was found. The correction is made in
// the frame half-way between the two headings: an error of the heading then turns the displacement by half of
// that error, and swapping the scans changes nothing.
Eigen::Vector2d DisplacementAt(double rotation_rad, const Pose2& T_ref_curr_odometry) {
  const double bend = 0.5 * AngleDiff(rotation_rad, T_ref_curr_odometry.theta);
  return Pose2{0.0, 0.0, bend}.rotation() * T_ref_curr_odometry.translation();
}

double LargestJump(const Pose2& T_ref_curr_odometry, const FaultOptions& options) {
  return options.max_translation_m + options.max_translation_share * T_ref_curr_odometry.translation().norm();
}

bool IsFault(const Pose2& answer, const Pose2& odometry, const FaultOptions& options) {
  return options.enabled &&
         ((answer.translation() - DisplacementAt(answer.theta, odometry)).norm() > LargestJump(odometry, options) ||
          std::abs(AngleDiff(answer.theta, odometry.theta)) > options.max_rotation_rad);
}

}  // namespace

VoteTable VoteForPairs(const ScanFeatures& ref, const ScanFeatures& curr, const Pose2& T_ref_curr_odometry,
                       const VotingOptions& options) {
  const int rows = static_cast<int>(ref.lines.size()), columns = static_cast<int>(curr.lines.size());
  VoteTable table(rows, columns), votes(rows, columns);
  const VoteWeightOptions& weights = options.weights;
  const CandidateTable candidates =
      VoteByPossibility(ref, curr, T_ref_curr_odometry, options.candidates, weights, table);
  const ScanPair scans{ref, curr, candidates};
  const auto add = [&](double weight, const auto& criterion) {
    votes.Clear();
    criterion();
    table.AddWeighted(votes, weight);
  };
  add(weights.long_lines, [&] { VoteByLongLines(scans, options.tolerances, weights.unique, votes); });
  add(weights.corners, [&] { VoteByRealCorners(scans, options.tolerances, weights.unique, votes); });
  add(weights.parallels, [&] { VoteByParallels(scans, options.tolerances, weights.unique, votes); });
  add(weights.lengths, [&] { VoteByLengths(scans, options.tolerances, weights.unique, votes); });
  add(weights.angle_patterns, [&] { VoteByAnglePatterns(scans, options.tolerances, votes); });
  add(weights.distance_patterns, [&] { VoteByDistancePatterns(scans, options.tolerances, votes); });
  return table;
}

VotingMatch MatchLinesByVoting(const ScanFeatures& ref, const ScanFeatures& curr, const Pose2& T_ref_curr_odometry,
                               const VotingOptions& options) {
  VotingMatch match;
  const auto fail = [&](MatchFailure failure) {
    match.result = FromOdometry(T_ref_curr_odometry, failure, options);
    for (LinePair& pair : match.pairs) pair.inlier = false;
    return match;
  };
  if (ref.lines.empty() || curr.lines.empty()) return fail(MatchFailure::kTooFewFeatures);

  const VoteTable table = VoteForPairs(ref, curr, T_ref_curr_odometry, options);
  match.pairs = SelectPairs(table, options.selection.min_votes, ref.full_turn && curr.full_turn);

  const auto rotation = RotationFromPairs(ref, curr, match.pairs, options.pose);
  if (!rotation) return fail(MatchFailure::kNoPairs);

  std::vector<PairOffset> offsets = OffsetsOf(ref, curr, match.pairs, rotation->rotation_rad, options.pose);
  if (offsets.empty()) return fail(MatchFailure::kInconsistent);
  const Eigen::Vector2d displacement = DisplacementAt(rotation->rotation_rad, T_ref_curr_odometry);
  if (options.fault.enabled) {
    const double largest = LargestJump(T_ref_curr_odometry, options.fault);
    std::erase_if(offsets,
                  [&](const PairOffset& o) { return std::abs(o.offset - o.normal.dot(displacement)) > largest; });
  }
  const auto translation = TranslationFromOffsets(offsets, rotation->rotation_rad, displacement, options.pose);
  if (!translation) return fail(MatchFailure::kFault);

  MatchResult& result = match.result;
  result.T_ref_curr = {translation->translation.x(), translation->translation.y(), rotation->rotation_rad};
  result.degenerate = translation->degenerate;
  result.degenerate_direction = translation->along;
  const double agreement = MarkInliers(ref, curr, result.T_ref_curr, options.pose, match.pairs);
  if (agreement < options.pose.min_inlier_share) return fail(MatchFailure::kInconsistent);
  if (IsFault(result.T_ref_curr, T_ref_curr_odometry, options.fault)) return fail(MatchFailure::kFault);

  for (const LinePair& pair : match.pairs) result.inliers += pair.inlier ? 1 : 0;
  result.score = MatchedShare(curr, match.pairs);
  result.iterations = 1;
  result.converged = true;
  result.covariance = PairsCovariance(ref, curr, match.pairs, result,
                                      OdometryCovariance(T_ref_curr_odometry, options.odometry), LineNoiseFloor{});
  return match;
}

MatchResult MatchByVoting(const ScanFeatures& ref, const ScanFeatures& curr, const Pose2& T_ref_curr_odometry,
                          const VotingOptions& options) {
  return MatchLinesByVoting(ref, curr, T_ref_curr_odometry, options).result;
}

}  // namespace cairn::slam
