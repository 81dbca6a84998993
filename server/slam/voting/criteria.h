// The seven criteria that vote for pairs of lines. Each fills its own sub-table (lines of the previous scan
// in rows, of the current scan in columns) with unweighted votes. Criteria 2 to 7 consider only the pairs
// that criterion 1 allows. An agreement that is the only one for its features counts `unique` votes instead
// of one. The criteria decide nothing: VoteForPairs weights and adds the sub-tables, and SelectPairs selects
// the pairs.
// Lines are in the robot frames of their scans. Stateless, thread-safe. Source: thesis A 3.5.2-3.5.8.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/voting/voting_options.h"

namespace cairn::slam {

// The position of line b along the direction of line a: beside it, wholly beyond its last end, or wholly
// before its first end. Source: thesis A 3.5.5 (Table 3.10, Figure 3.21).
enum class OverlapType : std::uint8_t { kOverlap, kBeyondLast, kBeforeFirst };
[[nodiscard]] OverlapType OverlapTypeOf(const LineFeature& a, const LineFeature& b);

// Goes through `walked` in order and takes for each entry the first later entry of `other` that differs by at
// most `tolerance`, as in the printed Tables 3.16 and 3.22. Blanks (NaN) are skipped. Differences of angles
// are wrapped. If `taken` is given, it receives the positions (in walked, in other). Returns the number of
// entries that agree.
[[nodiscard]] int PatternOverlap(std::span<const double> walked, std::span<const double> other, double tolerance,
                                 bool angles, std::vector<std::pair<int, int>>* taken = nullptr);

// The pairs of lines that are possible: rows for the previous scan, columns for the current one.
class CandidateTable {
 public:
  CandidateTable(int rows, int columns)
      : columns_(columns), flags_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0) {}
  [[nodiscard]] bool Has(int ref, int curr) const { return flags_[Index(ref, curr)] != 0; }
  void Add(int ref, int curr) { flags_[Index(ref, curr)] = 1; }

 private:
  [[nodiscard]] std::size_t Index(int ref, int curr) const {
    return static_cast<std::size_t>(ref) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(curr);
  }
  int columns_ = 0;
  std::vector<char> flags_;
};

// The two scans and the possible pairs, the input of criteria 2 to 7.
struct ScanPair {
  const ScanFeatures& ref;
  const ScanFeatures& curr;
  const CandidateTable& candidates;
};

// Criterion 1 (3.5.2): the pairs that the motion of the robot allows, given the prediction of odometry.
// Writes weighted votes: `impossible` for pairs that are not allowed; for the others from `possible` up to
// twice that value, if the prediction holds exactly.
[[nodiscard]] CandidateTable VoteByPossibility(const ScanFeatures& ref, const ScanFeatures& curr,
                                               const Pose2& T_ref_curr_odometry, const CandidateOptions& options,
                                               const VoteWeightOptions& weights, VoteTable& votes);

// Criterion 2 (3.5.3): lines that are much longer than all similar lines nearby.
void VoteByLongLines(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// Criterion 3 (3.5.4): real corners of equal angle. Both lines of a corner get votes.
void VoteByRealCorners(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// Criterion 4 (3.5.5): parallel lines at equal distance. Both lines get votes, and more of them if they
// overlap in the same way (Table 3.10).
void VoteByParallels(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// Criterion 5 (3.5.6): votes for both-ended lines of equal length, and against those of clearly different
// length.
void VoteByLengths(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes);

// Criterion 6 (3.5.7): sequences of lines with equal differences of slope.
void VoteByAnglePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes);

// Criterion 7 (3.5.8): sequences of corners with equal distances.
void VoteByDistancePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes);

// Endpoint tolerance (3-13): by how much the length of one both-ended line may differ between two views,
// because its ends fall between beams. It is twice the spacing of the beams along the line at each of the two
// ends, for the view with the larger spacing.
[[nodiscard]] double EndpointTolerance(const LineFeature& ref, const LineFeature& curr, double angle_step_rad);

}  // namespace cairn::slam
