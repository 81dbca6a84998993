// Every threshold and weight of the voting matcher. Defaults follow thesis A where it prints numbers (Tables 3.6-3.23
// for the weights) and what real logs need where it does not. Angles rad, lengths m, votes without unit.
#pragma once

#include <cstdint>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

// Criterion 1 (3.5.2): what the robot can have done beyond what its odometry says. The thesis, without a prediction,
// allows 60 deg.
struct CandidateOptions {
  double max_rotation_rad = Radians(30.0);  // Larger survives worse odometry and lets more wrong pairs compete.
  double max_translation_m = 1.0;           // Of a line across its direction.
};

// How far equal things may differ between two scans.
struct ToleranceOptions {
  double long_line_m = 1.5;                  // Criterion 2: lines from here on ...
  double long_line_ratio = 0.5;              // ... with no other of this share of their length ...
  double long_line_apart_m = 1.0;            // ... and the same slope this close, stand out.
  double corner_angle_rad = Radians(4.0);    // Criterion 3: angle of a real corner.
  double parallel_angle_rad = Radians(4.0);  // Criterion 4: lines this flat to each other are parallel.
  double parallel_distance_m = 0.05;         // Criterion 4: distance between parallel lines.
  double length_floor_m = 0.03;              // Criterion 5: added to the endpoint tolerance (3-13).
  double length_negative_m = 0.30;           // Criterion 5: both-ended lines that differ more are voted down.
  double pattern_angle_rad = Radians(2.65);  // Criterion 6 (reproduces Table 3.16).
  double pattern_distance_m = 0.05;          // Criterion 7 (reproduces Table 3.22).
  std::int64_t pattern_window = 5;           // Criteria 6, 7: rows compared with each row (Tables 3.15, 3.21).
};

// Votes per agreement before weighting, and weights per criterion (3.5.9).
struct VoteWeightOptions {
  double impossible = -40.0;    // Criterion 1, pairs the robot cannot have made (Table 3.6).
  double possible = 1.0;        // Criterion 1, all others; up to twice where the odometry's prediction holds exactly.
  double long_lines = 2.0;      // Criterion 2.
  double corners = 5.0;         // Criterion 3.
  double parallels = 3.0;       // Criterion 4.
  double lengths = 2.0;         // Criterion 5.
  double angle_patterns = 1.0;  // Criterion 6.
  double distance_patterns = 2.0;  // Criterion 7: harder to meet by chance than 6.
  double unique = 4.0;             // What an agreement met only once counts for, where a common one counts 1.
};

struct SelectionOptions {
  double min_votes = 8.0;  // Pairs below are no match (3.5.12.1). Larger: fewer and surer pairs.
};

// Rotation and translation (3.5.12.2-3) and what their answer must look like.
struct PoseOptions {
  double rotation_spread_rad = Radians(0.5);  // Outliers are removed until all slope differences are this near the mean
  double rotation_length_power = 2.0;       // Weight of a slope difference by length; the thesis takes 1, but a slope's
                                            // exactness grows faster than length: 2 is better on all three real logs.
  std::int64_t rotation_keep = 3;           // or only so many are left (Table 3.27).
  double pair_rotation_rad = Radians(4.0);  // Pairs turned otherwise take no part in the translation.
  double axis_rad = Radians(60.0);          // Lines this flat to an axis are near it (Table 3.28).
  double crossing_rad = Radians(30.0);      // Two lines must cross at least this steeply to give a translation.
  double translation_spread_m = 0.03;       // As rotation_spread_rad (Table 3.31).
  std::int64_t translation_keep = 3;
  double inlier_m = 0.10;            // A pair agrees with the answer within this across the line ...
  double inlier_rad = Radians(5.0);  // ... and this in slope.
  double min_inlier_share = 0.5;     // Of the selected pairs, by length; below: inconsistent.
};

// Optional check against the odometry (3.6.1). Pairs that would move the robot by more than this across their line take
// no part in the translation; an answer beyond the limits all the same is a fault. On the real logs answers 0.2 m off
// the odometry were wrong far more often than the odometry was, but of turns even 15 deg off the lines were right.
struct FaultOptions {
  bool enabled = true;
  double max_translation_m = 0.20;      // Larger survives worse odometry and lets more mismatches through ...
  double max_translation_share = 0.20;  // ... plus this share of the distance driven.
  double max_rotation_rad = Radians(25.0);
};

// What odometry is trusted for where it stands in for the lines: sigma = floor + share of the motion.
struct OdometryTrustOptions {
  double translation_floor_m = 0.02;
  double translation_share = 0.10;
  double rotation_floor_rad = Radians(1.0);
  double rotation_share = 0.10;
  double rotation_per_m = Radians(2.0);
};

struct VotingOptions {
  CandidateOptions candidates;
  ToleranceOptions tolerances;
  VoteWeightOptions weights;
  SelectionOptions selection;
  PoseOptions pose;
  FaultOptions fault;
  OdometryTrustOptions odometry;
  double line_sigma_floor_m = 0.004;                  // What a line's place is never better known than ...
  double line_slope_sigma_floor_rad = Radians(0.15);  // ... and its slope.
};
void Visit(OptionVisitor& visitor, VotingOptions& options);

}  // namespace cairn::slam
