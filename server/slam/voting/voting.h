// Matches two scans by their lines: seven criteria vote for pairs of lines, the pairs with the most votes are
// selected one to one, and rotation and translation follow from them. A good guess is not needed: the
// odometry may be wrong by up to the limits in CandidateOptions. It limits which pairs are possible, gives
// the translation along corridors, and is the result if there is no match. Not iterative and not a
// refinement: the result is about as exact as the lines are.
// Frames: features in the robot frames of their scans; the result is T_ref_curr. Swapping the scans (and
// inverting the odometry) gives the inverse. Stateless, thread-safe, deterministic.
//
// Failures (the result is the odometry with its covariance, and converged = false): kTooFewFeatures, a scan
// has no lines; kNoPairs, no pair has enough votes; kInconsistent, the pairs contradict each other; kFault,
// the result differs too much from the odometry (3.6.1). Without odometry (the identity as the guess) switch
// the fault check off.
// Corridor: the rotation and the translation across the corridor come from the lines, the translation along
// it from the odometry; the result is converged and degenerate. The same holds if all lines that constrain
// the translation along the corridor were dropped by the fault check.
// Source: thesis A 3.5 and 3.6.1.
#pragma once

#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/voting/criteria.h"
#include "server/slam/voting/voting_options.h"

namespace cairn::slam {

// The matching table: the weighted sum of the seven sub-tables (3.5.9).
[[nodiscard]] VoteTable VoteForPairs(const ScanFeatures& ref, const ScanFeatures& curr,
                                     const Pose2& T_ref_curr_odometry, const VotingOptions& options);

struct VotingMatch {
  MatchResult result;
  std::vector<LinePair> pairs;  // All selected pairs, ordered by `ref`; inliers agree with the result.
};

// The match with its pairs of lines, for a later refinement.
[[nodiscard]] VotingMatch MatchLinesByVoting(const ScanFeatures& ref, const ScanFeatures& curr,
                                             const Pose2& T_ref_curr_odometry, const VotingOptions& options);

[[nodiscard]] MatchResult MatchByVoting(const ScanFeatures& ref, const ScanFeatures& curr,
                                        const Pose2& T_ref_curr_odometry, const VotingOptions& options);

}  // namespace cairn::slam
