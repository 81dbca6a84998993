#include "server/slam/voting/voting_options.h"

namespace cairn::slam {
namespace {

void Visit(OptionVisitor& visitor, CandidateOptions& options) {
  visitor.Real(
      "max_rotation_rad", options.max_rotation_rad, "rad", 0.0, kPi,
      "Largest turn beyond the odometry. A larger value tolerates worse odometry, and more wrong pairs compete.");
  visitor.Real("max_translation_m", options.max_translation_m, "m", 0.0, 100.0,
               "Largest motion of a line across its direction beyond the odometry.");
}

void Visit(OptionVisitor& visitor, ToleranceOptions& options) {
  visitor.Real("long_line_m", options.long_line_m, "m", 0.0, 100.0,
               "Criterion 2: lines of at least this length are long.");
  visitor.Real(
      "long_line_ratio", options.long_line_ratio, "", 0.0, 1.0,
      "Criterion 2: a long line counts only if no similar line near it has more than this share of its length.");
  visitor.Real("long_line_apart_m", options.long_line_apart_m, "m", 0.0, 100.0,
               "Criterion 2: distance within which such a similar line is looked for.");
  visitor.Real("corner_angle_rad", options.corner_angle_rad, "rad", 0.0, 1.0,
               "Criterion 3: largest difference between the angles of two corners.");
  visitor.Real("parallel_angle_rad", options.parallel_angle_rad, "rad", 0.0, 1.0,
               "Criterion 4: largest angle between two lines that count as parallel.");
  visitor.Real("parallel_distance_m", options.parallel_distance_m, "m", 0.0, 1.0,
               "Criterion 4: largest difference between the distances of two pairs of parallel lines.");
  visitor.Real("length_floor_m", options.length_floor_m, "m", 0.0, 1.0,
               "Criterion 5: added to the tolerance that the endpoints have.");
  visitor.Real("length_negative_m", options.length_negative_m, "m", 0.0, 100.0,
               "Criterion 5: complete lines whose lengths differ by more are voted down.");
  visitor.Real("pattern_angle_rad", options.pattern_angle_rad, "rad", 0.0, 1.0,
               "Criterion 6: largest difference between two differences of slopes that count as equal.");
  visitor.Real("pattern_distance_m", options.pattern_distance_m, "m", 0.0, 1.0,
               "Criterion 7: largest difference between two distances of corners that count as equal.");
  visitor.Integer("pattern_window", options.pattern_window, "rows", 1, 100,
                  "Criteria 6 and 7: number of rows with which each row is compared.");
}

void Visit(OptionVisitor& visitor, VoteWeightOptions& options) {
  visitor.Real("impossible", options.impossible, "votes", -1e6, 0.0,
               "Criterion 1: votes for a pair that is impossible by the odometry.");
  visitor.Real(
      "possible", options.possible, "votes", 0.0, 1e3,
      "Criterion 1: votes for any other pair. A pair exactly where the odometry predicts it gets twice as many.");
  visitor.Real("long_lines", options.long_lines, "", 0.0, 1e3, "Weight of criterion 2, long lines.");
  visitor.Real("corners", options.corners, "", 0.0, 1e3, "Weight of criterion 3, real corners.");
  visitor.Real("parallels", options.parallels, "", 0.0, 1e3, "Weight of criterion 4, parallel lines.");
  visitor.Real("lengths", options.lengths, "", 0.0, 1e3, "Weight of criterion 5, lengths.");
  visitor.Real("angle_patterns", options.angle_patterns, "", 0.0, 1e3, "Weight of criterion 6, patterns of angles.");
  visitor.Real("distance_patterns", options.distance_patterns, "", 0.0, 1e3,
               "Weight of criterion 7, patterns of distances.");
  visitor.Real("unique", options.unique, "votes", 1.0, 1e3,
               "Votes for an agreement that occurs only once. A common one has 1 vote.");
}

void Visit(OptionVisitor& visitor, SelectionOptions& options) {
  visitor.Real("min_votes", options.min_votes, "votes", 0.0, 1e4,
               "Fewest votes of a pair that is accepted. A larger value gives fewer and more reliable pairs.");
}

void Visit(OptionVisitor& visitor, PoseOptions& options) {
  visitor.Real("rotation_spread_rad", options.rotation_spread_rad, "rad", 0.0, 1.0,
               "Outliers are removed until all turns differ at most by this from their mean.");
  visitor.Real("rotation_length_power", options.rotation_length_power, "", 0.0, 4.0,
               "Power of the length of the lines in the weight of a turn. The thesis uses 1.");
  visitor.Integer("rotation_keep", options.rotation_keep, "pairs", 1, 1000,
                  "Number of pairs that are never removed as outliers of the rotation.");
  visitor.Real("pair_rotation_rad", options.pair_rotation_rad, "rad", 0.0, 1.0,
               "Pairs whose turn differs by more from the rotation are not used for the translation.");
  visitor.Real("axis_rad", options.axis_rad, "rad", 0.0, kPi / 2,
               "Lines at a smaller angle to an axis count as near to it.");
  visitor.Real("crossing_rad", options.crossing_rad, "rad", 0.01, kPi / 2,
               "Smallest angle between two lines that give a translation.");
  visitor.Real("translation_spread_m", options.translation_spread_m, "m", 0.0, 10.0,
               "Outliers are removed until all translations differ at most by this from their mean.");
  visitor.Integer("translation_keep", options.translation_keep, "", 1, 1000,
                  "Number of translations that are never removed as outliers.");
  visitor.Real("inlier_m", options.inlier_m, "m", 0.0, 10.0,
               "A pair agrees with the answer within this distance across the line.");
  visitor.Real("inlier_rad", options.inlier_rad, "rad", 0.0, 1.0, "A pair agrees with the answer within this angle.");
  visitor.Real("min_inlier_share", options.min_inlier_share, "", 0.0, 1.0,
               "Share of the pairs, by length, that must agree with the answer. With less there is no match.");
}

void Visit(OptionVisitor& visitor, FaultOptions& options) {
  visitor.Flag("enabled", options.enabled, "Whether answers that are far from the odometry are refused.");
  visitor.Real("max_translation_m", options.max_translation_m, "m", 0.0, 100.0,
               "Largest difference between the translation of an answer and the odometry. A larger value tolerates "
               "worse odometry, and more wrong matches pass.");
  visitor.Real("max_translation_share", options.max_translation_share, "m/m", 0.0, 10.0,
               "Added to max_translation_m per metre driven.");
  visitor.Real("max_rotation_rad", options.max_rotation_rad, "rad", 0.0, kPi,
               "Largest difference between the turn of an answer and the odometry.");
}

void Visit(OptionVisitor& visitor, OdometryNoiseOptions& options) {
  visitor.Real("translation_floor_m", options.translation_floor_m, "m", 1e-4, 10.0,
               "Standard deviation of the translation of the odometry without motion.");
  visitor.Real("translation_share", options.translation_share, "m/m", 0.0, 10.0,
               "Standard deviation of the translation of the odometry per metre driven.");
  visitor.Real("rotation_floor_rad", options.rotation_floor_rad, "rad", 1e-5, 3.0,
               "Standard deviation of the turn of the odometry without motion.");
  visitor.Real("rotation_share", options.rotation_share, "rad/rad", 0.0, 10.0,
               "Standard deviation of the turn of the odometry per radian turned.");
  visitor.Real("rotation_per_m", options.rotation_per_m, "rad/m", 0.0, 3.0,
               "Standard deviation of the turn of the odometry per metre driven.");
}

}  // namespace

void Visit(OptionVisitor& visitor, VotingOptions& options) {
  visitor.Section("candidates", "Criterion 1: which pairs are possible.", [&] { Visit(visitor, options.candidates); });
  visitor.Section("tolerances", "How far equal things may differ between two scans.",
                  [&] { Visit(visitor, options.tolerances); });
  visitor.Section("weights", "Votes and weights of the criteria.", [&] { Visit(visitor, options.weights); });
  visitor.Section("selection", "From votes to pairs.", [&] { Visit(visitor, options.selection); });
  visitor.Section("pose", "From pairs to a motion.", [&] { Visit(visitor, options.pose); });
  visitor.Section("fault", "Comparison of the answer with the odometry.", [&] { Visit(visitor, options.fault); });
  visitor.Section("odometry", "Uncertainty of the odometry, which decides where the lines do not.",
                  [&] { Visit(visitor, options.odometry); });
}

}  // namespace cairn::slam
