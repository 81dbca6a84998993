#include "server/slam/mapper_options.h"

#include <algorithm>
#include <limits>

#include "common/options/config.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, MapperOptions& options) {
  visitor.Integer("seed", options.seed, "1", 0, std::numeric_limits<std::int64_t>::max(),
                  ForOperators("Seed of the random numbers. Every robot starts from the same one, so that it computes "
                               "the same alone and in a fleet."));
  Visit(visitor, options.filter);
  visitor.Real("lost_after_m", options.lost_after_m, "m", 0.0, 1000.0,
               "A robot that has travelled farther than this by odometry alone counts as lost.");
  visitor.Integer("max_keyframes", options.max_keyframes, "keyframes", 1, 100000000,
                  "Keyframes that one session keeps, some 3.5 KiB each. When it has as many, its scans are dropped "
                  "as session_full.");
  visitor.Integer("max_chunks", options.max_chunks, "chunks", 1, 10000000,
                  "Pieces of the map of one session, 32 KiB each. When it has as many, its scans are "
                  "dropped as session_full.");
  visitor.Section(
      "blind",
      "Uncertainty of a whole motion that odometry alone shows: under tilted scans, and of a robot that is looked for.",
      [&] { Visit(visitor, options.blind); });
  visitor.Section("odometry_walk",
                  "Uncertainty of the steps that odometry alone shows: of scans without a match, and along a corridor.",
                  [&] { Visit(visitor, options.odometry_walk); });
  visitor.Real("max_tilt_rad", options.max_tilt_rad, "rad", 0.0, 1.58,
               ForOperators("A scan of a robot that is tilted by more than this is neither matched nor drawn; its pose "
                            "comes from odometry."));
  VisitEnum(visitor, "matcher", options.matcher, MatcherNames(),
            ForOperators("The method that estimates the motion between two scans."));
  visitor.Section("matching",
                  "The methods that estimate the motion between scans. Only the one that slam.matcher names is used.",
                  [&] { Visit(visitor, options.matching); });
  visitor.Section("front_end", "Tracking from scan to scan.", [&] { Visit(visitor, options.front_end); });
  visitor.Section("gate", "After which motion a scan becomes a keyframe, which updates filter and map.",
                  [&] { Visit(visitor, options.gate); });
  visitor.Section("revisit", "Recognising places that were seen before.", [&] { Visit(visitor, options.revisit); });
  visitor.Section("loop", "Finding large loops.", [&] { Visit(visitor, options.loop); });
  visitor.Section("self_check", "Noticing that the scans contradict the map.",
                  [&] { Visit(visitor, options.self_check); });
  visitor.Section("recovery", "Finding a robot again in its map that was not watched for some time.",
                  [&] { Visit(visitor, options.recovery); });
  visitor.Section("pose_graph", "Least squares over the whole path, for smoothing.",
                  [&] { Visit(visitor, options.pose_graph); });
  visitor.Section("retire", "Forgetting keyframes that show nothing new.", [&] { Visit(visitor, options.retire); });
  visitor.Section("grid", "The occupancy grid.", [&] { Visit(visitor, options.grid); });
  visitor.Section("pairing", "Finding the odometry at the time of each scan.",
                  [&] { Visit(visitor, options.pairing); });
  visitor.Section("learning", "What is learned of the wheels and of the lag of the lidar while the robot drives.",
                  [&] { Visit(visitor, options.learning); });
}

MapperOptions ForScansAlone(MapperOptions options) {
  constexpr double kSearchedM = 6.0;
  constexpr std::int64_t kNeighbours = 20;
  options.front_end.use_odometry = false;
  // The default compares lines from where odometry says that the robot is.
  if (options.matcher == MapperOptions{}.matcher) options.matcher = MatcherKind::kNdt;
  options.revisit.max_distance_m = std::max(options.revisit.max_distance_m, kSearchedM);
  options.revisit.neighbours = std::max(options.revisit.neighbours, kNeighbours);
  NoOdometryOptions& forecast = options.front_end.no_odometry;
  forecast.merged_keyframes = std::min(forecast.merged_keyframes, options.front_end.reference_keyframes);
  return options;
}

Result<void> Validate(const MapperOptions& options) {
  MapperOptions copy = options;
  return CheckRules([&copy](OptionVisitor& visitor) { visitor.Section("slam", "", [&] { Visit(visitor, copy); }); });
}

}  // namespace cairn::slam
