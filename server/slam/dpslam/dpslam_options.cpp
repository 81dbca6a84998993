#include "server/slam/dpslam/dpslam_options.h"

#include <array>
#include <string_view>

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 3> kLowMotionNames = {"gaussian", "eliazar", "scan_matching"};

}  // namespace

void Visit(OptionVisitor& visitor, LowMotion& motion) {
  VisitEnum(visitor, "motion", motion, kLowMotionNames,
            "How the low level samples a step: low.drift, or with what slam.motion says.");
}

void Visit(OptionVisitor& visitor, DpSlamOptions& options) {
  visitor.Flag("hierarchical", options.hierarchical, "Two levels; one alone drifts over long loops.");
  Visit(visitor, options.motion);
  visitor.Section("opacity", "The cells of the particles' maps.", [&] { Visit(visitor, options.opacity); });
  visitor.Section("low", "From scan to scan.", [&] { Visit(visitor, options.low); });
  visitor.Section("high", "From segment to segment.", [&] { Visit(visitor, options.high); });
  visitor.Section("segment", "What the low level hands up.", [&] {
    SegmentOptions& segment = options.segment;
    visitor.Real("length_m", segment.length_m, "m", 0.0, 1000.0, "Travelled before a segment may end.");
    visitor.Real("straight_rad", segment.straight_rad, "rad", 0.0, 3.2,
                 "A segment does not end in a step that turns more, unless it is full.");
    visitor.Integer("max_scans", segment.max_scans, "1", 1, 10000, "A segment with so many scans is full.");
    visitor.Integer("hindsight_scans", segment.hindsight_scans, "1", 0, 1000,
                    "The low level goes on so long before a segment is handed up.");
    visitor.Real("keep_m", segment.keep_m, "m", 1.0, 1000.0,
                 "The low level forgets what is farther away; more than the laser sees.");
    visitor.Integer("trajectories", segment.trajectories, "1", 1, 1000,
                    "Of the low level, for the high level to choose from.");
  });
  visitor.Integer("diverged_after", options.diverged_after, "1", 1, 1000000,
                  "Scans in a row that the map contradicts before the filter says it is lost.");
}

}  // namespace cairn::slam
