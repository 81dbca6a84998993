#include "server/slam/matching/voting_options.h"

namespace cairn::slam {
namespace {

void Visit(OptionVisitor& visitor, CandidateOptions& options) {
  visitor.Real("max_rotation_rad", options.max_rotation_rad, "rad", 0.0, kPi, "turn beyond what odometry says");
  visitor.Real("max_translation_m", options.max_translation_m, "m", 0.0, 100.0, "motion beyond what odometry says");
}

void Visit(OptionVisitor& visitor, ToleranceOptions& options) {
  visitor.Real("long_line_m", options.long_line_m, "m", 0.0, 100.0, "criterion 2: shortest long line");
  visitor.Real("long_line_ratio", options.long_line_ratio, "", 0.0, 1.0, "criterion 2: rivals from this share on");
  visitor.Real("long_line_apart_m", options.long_line_apart_m, "m", 0.0, 100.0, "criterion 2: rivals this close");
  visitor.Real("corner_angle_rad", options.corner_angle_rad, "rad", 0.0, 1.0, "criterion 3: angle of a real corner");
  visitor.Real("parallel_angle_rad", options.parallel_angle_rad, "rad", 0.0, 1.0, "criterion 4: parallel within this");
  visitor.Real("parallel_distance_m", options.parallel_distance_m, "m", 0.0, 1.0, "criterion 4: distance of parallels");
  visitor.Real("length_floor_m", options.length_floor_m, "m", 0.0, 1.0, "criterion 5: added to the endpoint tolerance");
  visitor.Real("length_negative_m", options.length_negative_m, "m", 0.0, 100.0, "criterion 5: difference voted down");
  visitor.Real("pattern_angle_rad", options.pattern_angle_rad, "rad", 0.0, 1.0, "criterion 6: equal slope differences");
  visitor.Real("pattern_distance_m", options.pattern_distance_m, "m", 0.0, 1.0, "criterion 7: equal corner distances");
  visitor.Integer("pattern_window", options.pattern_window, "rows", 1, 100, "criteria 6, 7: rows compared with each");
}

void Visit(OptionVisitor& visitor, VoteWeightOptions& options) {
  visitor.Real("impossible", options.impossible, "votes", -1e6, 0.0, "criterion 1: pairs the robot cannot have made");
  visitor.Real("possible", options.possible, "votes", 0.0, 1e3, "criterion 1: other pairs; twice on the prediction");
  visitor.Real("long_lines", options.long_lines, "", 0.0, 1e3, "weight of criterion 2");
  visitor.Real("corners", options.corners, "", 0.0, 1e3, "weight of criterion 3");
  visitor.Real("parallels", options.parallels, "", 0.0, 1e3, "weight of criterion 4");
  visitor.Real("lengths", options.lengths, "", 0.0, 1e3, "weight of criterion 5");
  visitor.Real("angle_patterns", options.angle_patterns, "", 0.0, 1e3, "weight of criterion 6");
  visitor.Real("distance_patterns", options.distance_patterns, "", 0.0, 1e3, "weight of criterion 7");
  visitor.Real("unique", options.unique, "votes", 1.0, 1e3, "inner weight of an agreement met only once");
}

void Visit(OptionVisitor& visitor, SelectionOptions& options) {
  visitor.Real("min_votes", options.min_votes, "votes", 0.0, 1e4, "fewest votes of a match");
}

void Visit(OptionVisitor& visitor, PoseOptions& options) {
  visitor.Real("rotation_spread_rad", options.rotation_spread_rad, "rad", 0.0, 1.0, "slope differences kept");
  visitor.Real("rotation_length_power", options.rotation_length_power, "", 0.0, 4.0,
               "weight of a slope difference by length of the lines; the thesis: 1");
  visitor.Integer("rotation_keep", options.rotation_keep, "pairs", 1, 1000, "pairs never removed from the rotation");
  visitor.Real("pair_rotation_rad", options.pair_rotation_rad, "rad", 0.0, 1.0, "pairs used for the translation");
  visitor.Real("axis_rad", options.axis_rad, "rad", 0.0, kPi / 2, "lines this flat to an axis are near it");
  visitor.Real("crossing_rad", options.crossing_rad, "rad", 0.01, kPi / 2, "least crossing of two lines for a place");
  visitor.Real("translation_spread_m", options.translation_spread_m, "m", 0.0, 10.0, "translations kept");
  visitor.Integer("translation_keep", options.translation_keep, "", 1, 1000, "translations never removed");
  visitor.Real("inlier_m", options.inlier_m, "m", 0.0, 10.0, "a pair agrees within this across the line");
  visitor.Real("inlier_rad", options.inlier_rad, "rad", 0.0, 1.0, "a pair agrees within this in slope");
  visitor.Real("min_inlier_share", options.min_inlier_share, "", 0.0, 1.0, "less agreement is no answer");
}

void Visit(OptionVisitor& visitor, FaultOptions& options) {
  visitor.Flag("enabled", options.enabled, "refuse answers far from the odometry");
  visitor.Real("max_translation_m", options.max_translation_m, "m", 0.0, 100.0, "largest difference to odometry");
  visitor.Real("max_translation_share", options.max_translation_share, "m/m", 0.0, 10.0, "added per distance driven");
  visitor.Real("max_rotation_rad", options.max_rotation_rad, "rad", 0.0, kPi, "largest difference to odometry");
}

void Visit(OptionVisitor& visitor, OdometryTrustOptions& options) {
  visitor.Real("translation_floor_m", options.translation_floor_m, "m", 1e-4, 10.0, "sigma without motion");
  visitor.Real("translation_share", options.translation_share, "m/m", 0.0, 10.0, "sigma per distance");
  visitor.Real("rotation_floor_rad", options.rotation_floor_rad, "rad", 1e-5, 3.0, "sigma without motion");
  visitor.Real("rotation_share", options.rotation_share, "rad/rad", 0.0, 10.0, "sigma per turn");
  visitor.Real("rotation_per_m", options.rotation_per_m, "rad/m", 0.0, 3.0, "sigma per distance");
}

}  // namespace

void Visit(OptionVisitor& visitor, VotingOptions& options) {
  visitor.Section("candidates", "Criterion 1: which pairs are possible", [&] { Visit(visitor, options.candidates); });
  visitor.Section("tolerances", "What counts as equal", [&] { Visit(visitor, options.tolerances); });
  visitor.Section("weights", "Votes and weights of the criteria", [&] { Visit(visitor, options.weights); });
  visitor.Section("selection", "From votes to pairs", [&] { Visit(visitor, options.selection); });
  visitor.Section("pose", "From pairs to a motion", [&] { Visit(visitor, options.pose); });
  visitor.Section("fault", "Check against odometry", [&] { Visit(visitor, options.fault); });
  visitor.Section("odometry", "Trust in odometry where lines do not tell", [&] { Visit(visitor, options.odometry); });
  visitor.Real("line_sigma_floor_m", options.line_sigma_floor_m, "m", 1e-5, 1.0, "least sigma of a line's place");
  visitor.Real("line_slope_sigma_floor_rad", options.line_slope_sigma_floor_rad, "rad", 1e-5, 1.0,
               "least sigma of a line's slope");
}

}  // namespace cairn::slam
