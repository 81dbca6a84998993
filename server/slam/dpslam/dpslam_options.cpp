#include "server/slam/dpslam/dpslam_options.h"

#include <array>
#include <string_view>

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 3> kLowMotionNames = {"gaussian", "eliazar", "scan_matching"};
constexpr std::array<std::string_view, 2> kHighLevelNames = {"moving", "plain"};

}  // namespace

void Visit(OptionVisitor& visitor, LowMotion& motion) {
  VisitEnum(visitor, "motion", motion, kLowMotionNames,
            "How the low level draws the motion of a step. gaussian uses low.drift; eliazar and scan_matching use the "
            "models of slam.motion.");
}

void Visit(OptionVisitor& visitor, DpSlamOptions& options) {
  visitor.Flag("hierarchical", options.hierarchical,
               "Whether there are two levels. One level alone drifts in long loops.");
  VisitEnum(visitor, "high_level", options.high_level, kHighLevelNames,
            "How two levels join segments. With moving, particles move where a loop closes; with plain, each draws all "
            "of the drift and is resampled at every joint, as thesis C prints it.");
  Visit(visitor, options.motion);
  visitor.Section("opacity", "The cells of the maps of the particles.", [&] { Visit(visitor, options.opacity); });
  visitor.Section("low", "The lower level, which goes from scan to scan.", [&] { Visit(visitor, options.low); });
  visitor.Section("high", "The upper level, which goes from segment to segment.",
                  [&] { Visit(visitor, options.high); });
  visitor.Section("segment", "The segments of the path that the lower level hands to the upper one.", [&] {
    SegmentOptions& segment = options.segment;
    visitor.Real("length_m", segment.length_m, "m", 0.0, 1000.0,
                 "A segment may end when the robot has travelled this far in it. Longer segments have fewer joints, "
                 "and more drift within.");
    visitor.Real("straight_rad", segment.straight_rad, "rad", 0.0, 3.2,
                 "A segment does not end in a step with a larger turn, unless it has max_scans.");
    visitor.Integer("max_scans", segment.max_scans, "1", 1, 10000, "A segment ends at the latest after so many scans.");
    visitor.Real("keep_m", segment.keep_m, "m", 1.0, 1000.0,
                 "The lower level forgets the map beyond this distance. It must be farther than the laser sees.");
    visitor.Integer("trajectories", segment.trajectories, "1", 1, 1000,
                    "Number of trajectories of the lower level from which the upper one chooses.");
  });
  visitor.Integer("diverged_after", options.diverged_after, "1", 1, 1000000,
                  "Number of scans in a row that contradict the map after which the robot counts as not localized.");
  visitor.Require(!options.hierarchical || options.segment.keep_m >= options.opacity.max_ray_m, "segment.keep_m",
                  "must be at least", "opacity.max_ray_m");
}

}  // namespace cairn::slam
