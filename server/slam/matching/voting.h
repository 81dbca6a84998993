// Matches two scans by their lines: seven criteria vote for pairs of lines, the surest pairs are selected one to one,
// and rotation and translation follow from them. Needs no good guess: the odometry may be off by the limits in
// CandidateOptions; it says which pairs are possible, decides along corridors, and is the answer when there is none.
// Not iterative, not a refinement: about as exact as the lines are.
// Frames: features in the robot frames of their scans; answer T_prev_curr. Swapping the scans (and inverting the
// odometry) gives the inverse. Stateless, thread-safe, deterministic.
//
// Failures (the answer is the odometry with its covariance, converged = false): kTooFewFeatures, a scan without lines;
// kNoPairs, no pair with enough votes; kInconsistent, the pairs contradict each other; kFault, the answer jumps against
// the odometry (3.6.1). Without odometry (identity as the guess) switch the fault check off.
// Corridor: rotation and the place across it from the lines, along it from the odometry; converged and degenerate. The
// same where all lines that would tell the place along it were dropped as jumps.
// Source: thesis A 3.5 and 3.6.1.
#pragma once

#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/criteria.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/matching/voting_options.h"

namespace cairn::slam {

// The matching table: the weighted sum of the seven sub-tables (3.5.9).
[[nodiscard]] VoteTable VoteForPairs(const ScanFeatures& prev, const ScanFeatures& curr,
                                     const Pose2& T_prev_curr_odometry, const VotingOptions& options);

struct VotingMatch {
  MatchResult result;
  std::vector<LinePair> pairs;  // All selected pairs, ordered by `prev`; inliers agree with the result.
};

// The match with the pairs behind it, for refinement.
[[nodiscard]] VotingMatch MatchLinesByVoting(const ScanFeatures& prev, const ScanFeatures& curr,
                                             const Pose2& T_prev_curr_odometry, const VotingOptions& options);

[[nodiscard]] MatchResult MatchByVoting(const ScanFeatures& prev, const ScanFeatures& curr,
                                        const Pose2& T_prev_curr_odometry, const VotingOptions& options);

}  // namespace cairn::slam
