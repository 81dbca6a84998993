// All thresholds and weights of the voting matcher. Defaults follow thesis A where it prints numbers (Tables
// 3.6-3.23 for the weights), and otherwise what the real logs need. Angles in rad, lengths in m, votes
// without unit.
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/matching/match_covariance.h"

namespace cairn::slam {

// Criterion 1 (3.5.2): the largest motion of the robot beyond what its odometry measured. The thesis, which
// has no prediction, allows 60 deg.
struct CandidateOptions {
  double max_rotation_rad = Radians(30.0);
  double max_translation_m = 1.0;
};

// Tolerances within which features of two scans count as equal.
struct ToleranceOptions {
  double long_line_m = 1.5;
  double long_line_ratio = 0.5;
  double long_line_apart_m = 1.0;
  double corner_angle_rad = Radians(4.0);
  double parallel_angle_rad = Radians(4.0);
  double parallel_distance_m = 0.05;
  double length_floor_m = 0.03;  // (3-13).
  double length_negative_m = 0.30;
  double pattern_angle_rad = Radians(2.65);  // Reproduces Table 3.16.
  double pattern_distance_m = 0.05;          // Reproduces Table 3.22.
  std::int64_t pattern_window = 5;           // Tables 3.15 and 3.21.
};

// Votes per agreement before weighting, and weights per criterion (3.5.9).
struct VoteWeightOptions {
  double impossible = -40.0;  // Table 3.6.
  double possible = 1.0;
  double long_lines = 2.0;
  double corners = 5.0;
  double parallels = 3.0;
  double lengths = 2.0;
  double angle_patterns = 1.0;
  double distance_patterns = 2.0;  // Harder to meet by chance than patterns of angles.
  double unique = 4.0;
};

struct SelectionOptions {
  double min_votes = 8.0;  // 3.5.12.1.
};

// Rotation and translation (3.5.12.2-3), and the conditions that their result must meet.
struct PoseOptions {
  double rotation_spread_rad = Radians(0.5);
  // A slope becomes more exact faster than a line becomes longer: 2 is better than 1 on all three real logs.
  double rotation_length_power = 2.0;
  std::int64_t rotation_keep = 3;  // Table 3.27.
  double pair_rotation_rad = Radians(4.0);
  double axis_rad = Radians(60.0);  // Table 3.28.
  double crossing_rad = Radians(30.0);
  double translation_spread_m = 0.03;  // Table 3.31.
  std::int64_t translation_keep = 3;
  double inlier_m = 0.10;
  double inlier_rad = Radians(5.0);
  double min_inlier_share = 0.5;
};

// Optional comparison of the result with the odometry (3.6.1). Pairs that would move the robot across their
// line by more than the limit are not used for the translation; a result that still exceeds the limits is a
// fault. On the real logs, results 0.2 m away from the odometry were wrong far more often than the odometry
// was. For turns, the lines were right even 15 deg away from the odometry.
struct FaultOptions {
  bool enabled = true;
  double max_translation_m = 0.20;
  double max_translation_share = 0.20;
  double max_rotation_rad = Radians(25.0);
};

struct VotingOptions {
  CandidateOptions candidates;
  ToleranceOptions tolerances;
  VoteWeightOptions weights;
  SelectionOptions selection;
  PoseOptions pose;
  FaultOptions fault;
  OdometryNoiseOptions odometry;
};
void Visit(OptionVisitor& visitor, VotingOptions& options);

}  // namespace cairn::slam
