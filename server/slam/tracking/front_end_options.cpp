#include "server/slam/tracking/front_end.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, NoOdometryOptions& options) {
  visitor.Flag(
      "constant_velocity", options.constant_velocity,
      "Whether the robot is expected to move on as between the last two scans. If not, it is expected to stand still.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.001, 100.0,
               "Standard deviation of the expected position. With a larger value the scan decides more.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.001, kPi, "Standard deviation of the expected heading.");
  visitor.Real("unmatched_step_m", options.unmatched_step_m, "m", 0.0, 100.0,
               "Way that a scan without a match counts for slam.lost_after_m.");
  visitor.Integer("merged_keyframes", options.merged_keyframes, "1", 1, 1000,
                  "Number of the reference keyframes whose points the matcher sees as one scan. With more the estimate "
                  "is less drawn towards standing still.");
}

void Visit(OptionVisitor& visitor, RetryOptions& options) {
  visitor.Real(
      "turn_step_rad", options.turn_step_rad, "rad", 0.01, 0.75,
      "Turns of one to four times this angle to either side are tried, because odometry may have frozen during "
      "a turn. With twice the angle the online error on mit-csail is 1.8 times as large; "
      "another seed alone changes it up to 1.3 times.");
  visitor.Real(
      "sigma_m", options.sigma_m, "m", 0.01, 10.0,
      "Standard deviation of the position of such a guess. With half the value the online error on mit-csail is "
      "1.3 times as large, which is what another seed can cause as well.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.01, kPi,
               "Standard deviation of the heading of such a guess. With half the value the walls of the map of "
               "mines are 12 % thicker.");
}

void Visit(OptionVisitor& visitor, FrontEndOptions& options) {
  visitor.Section("features", "Lines and corners of a scan.", [&] { Visit(visitor, options.features); });
  visitor.Section("surface", "Points of a scan with the directions of their surfaces.",
                  [&] { Visit(visitor, options.surface); });
  visitor.Section("refine", "Point-to-line alignment with the reference keyframes after the matcher.", [&] {
    visitor.Flag("enabled", options.refine_enabled,
                 "Whether the answer of the matcher is refined. If not, it is the pose.");
    Visit(visitor, options.refine);
  });
  visitor.Section("odometry", "Uncertainty of the odometry between two scans.",
                  [&] { Visit(visitor, options.odometry); });
  visitor.Flag("use_odometry", options.use_odometry,
               ForOperators("Whether odometry is used. If not, the motion comes from the scans alone."));
  visitor.Section("no_odometry", "What replaces the odometry if use_odometry is false.",
                  [&] { Visit(visitor, options.no_odometry); });
  visitor.Integer("reference_keyframes", options.reference_keyframes, "1", 1, 1000,
                  "Number of the last keyframes against which a scan is aligned. With more the tracking is steadier, "
                  "until drift blurs them.");
  visitor.Real("retry_below", options.retry_below, "1", 0.0, 1.0,
               "With a lower score, other guesses than the odometry are tried.");
  visitor.Section("retry", "The other guesses. They come from older odometry, standing still, and turns on the spot.",
                  [&] { Visit(visitor, options.retry); });
  visitor.Real("keep_above", options.keep_above, "1", 0.0, 1.0,
               "Without refinement: from this score on icp and correlative keep their reference scan. A lower value "
               "gives less drift while the reference lasts, and poorer matches.");
  visitor.Real("max_jump_sigma", options.max_jump_sigma, "1", 0.5, 1000.0,
               "Without refinement: a match that is more standard deviations away from the odometry is refused.");
  visitor.Require(options.use_odometry || options.no_odometry.merged_keyframes <= options.reference_keyframes,
                  "no_odometry.merged_keyframes", "must not exceed", "reference_keyframes");
}

}  // namespace cairn::slam
