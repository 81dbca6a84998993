// The seven criteria that vote for pairs of lines. Each fills its own sub-table (previous scan in rows, current in
// columns) with unweighted votes; criteria 2 to 7 look only at the pairs criterion 1 leaves. An agreement met only once
// counts `unique` votes instead of one. Nothing here decides: VotingMatcher weighs, adds and selects.
// Lines in the robot frames of their scans. Stateless, thread-safe. Source: thesis A 3.5.2-3.5.8.
#pragma once

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/matching/voting_options.h"

namespace cairn::slam {

// Which pairs are worth looking at: rows previous, columns current.
class CandidateTable {
 public:
  CandidateTable(int rows, int columns)
      : columns_(columns), flags_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0) {}
  [[nodiscard]] bool Has(int prev, int curr) const { return flags_[Index(prev, curr)] != 0; }
  void Add(int prev, int curr) { flags_[Index(prev, curr)] = 1; }

 private:
  [[nodiscard]] std::size_t Index(int prev, int curr) const {
    return static_cast<std::size_t>(prev) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(curr);
  }
  int columns_ = 0;
  std::vector<char> flags_;
};

// The two scans as every criterion sees them.
struct ScanPair {
  const ScanFeatures& prev;
  const ScanFeatures& curr;
  const CandidateTable& candidates;
};

// 1 (3.5.2): pairs the robot could have made, given what odometry predicts. Writes the final votes, not unit ones:
// `impossible`, or from `possible` up to twice that where the prediction holds exactly.
[[nodiscard]] CandidateTable VoteByPossibility(const ScanFeatures& prev, const ScanFeatures& curr,
                                               const Pose2& T_prev_curr_odometry, const CandidateOptions& options,
                                               const VoteWeightOptions& weights, VoteTable& votes);

// 2 (3.5.3): lines much longer than any like them nearby.
void VoteByLongLines(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// 3 (3.5.4): real corners of equal angle, for both lines.
void VoteByRealCorners(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// 4 (3.5.5): parallel lines at equal distance, for both lines; more where they overlap the same way (Table 3.10).
void VoteByParallels(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// 5 (3.5.6): both-ended lines of equal length; against pairs of clearly different length.
void VoteByLengths(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// 6 (3.5.7): runs of lines with equal slope differences.
void VoteByAnglePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes);

// 7 (3.5.8): runs of corners with equal distances.
void VoteByDistancePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes);

// Endpoint tolerance (3-13): how far the lengths of one both-ended line may differ between two views, because its ends
// fall between beams: twice the beams' spacing at each of the two ends, for the farther view, on the line's slope.
[[nodiscard]] double EndpointTolerance(const LineFeature& prev, const LineFeature& curr, double angle_step_rad);

}  // namespace cairn::slam
