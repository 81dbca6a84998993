#include "server/slam/mapper_options.h"

#include <limits>

namespace cairn::slam {

void Visit(OptionVisitor& visitor, MapperOptions& options) {
  visitor.Integer("seed", options.seed, "1", 0, std::numeric_limits<std::int64_t>::max(),
                  "Of every robot's random engine.");
  Visit(visitor, options.filter);
  visitor.Real("lost_after_m", options.lost_after_m, "m", 0.0, 1000.0,
               "Travelled by odometry alone before the robot counts as lost.");
  visitor.Section("blind", "Noise of motion known by odometry alone, besides the drift.",
                  [&] { Visit(visitor, options.blind); });
  visitor.Real("max_tilt_rad", options.max_tilt_rad, "rad", 0.0, 1.58,
               "Scans tilted further get a pose from odometry but are not matched or drawn.");
  VisitEnum(visitor, "matcher", options.matcher, MatcherNames(), "What compares a scan with the last keyframe.");
  visitor.Section("matching", "The matchers; the chosen one's options count.",
                  [&] { Visit(visitor, options.matching); });
  visitor.Section("front_end", "From scan to scan.", [&] { Visit(visitor, options.front_end); });
  visitor.Section("gate", "When a scan is worth an update of filter and map.", [&] { Visit(visitor, options.gate); });
  visitor.Section("revisit", "Recognising places seen before.", [&] { Visit(visitor, options.revisit); });
  visitor.Section("loop", "Finding large loops.", [&] { Visit(visitor, options.loop); });
  visitor.Section("self_check", "Noticing that scans and map contradict each other.",
                  [&] { Visit(visitor, options.self_check); });
  visitor.Section("pose_graph", "The path that fits all loops best.", [&] { Visit(visitor, options.pose_graph); });
  visitor.Section("grid", "The occupancy grid.", [&] { Visit(visitor, options.grid); });
  visitor.Section("pairing", "Joining scans and odometry by their stamps.", [&] { Visit(visitor, options.pairing); });
}

}  // namespace cairn::slam
