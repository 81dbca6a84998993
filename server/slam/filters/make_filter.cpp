#include "server/slam/filters/make_filter.h"

#include <array>
#include <string_view>

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 1> kFilterNames = {"fastslam2_points"};

}  // namespace

void Visit(OptionVisitor& visitor, FilterOptions& options) {
  VisitEnum(visitor, "filter", options.kind, kFilterNames, "What estimates path and landmarks.");
  visitor.Integer("particles", options.particles, "1", 1, 10000,
                  "More: larger loops close, in proportionally more time and memory.");
  visitor.Section("landmarks", "Which features become landmarks, and when one is seen again.",
                  [&] { Visit(visitor, options.landmarks); });
  visitor.Section("fastslam", "FastSLAM.", [&] { Visit(visitor, options.fastslam); });
}

std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options, const Pose2& T_map_robot_start,
                                   std::uint64_t seed) {
  switch (kind) {
    case FilterKind::kFastSlam2Points:
      break;
  }
  return std::make_unique<FastSlam2>(options.fastslam, options.landmarks, options.particles, T_map_robot_start, seed);
}

}  // namespace cairn::slam
