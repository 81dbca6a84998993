#include "server/slam/filters/make_filter.h"

#include <array>
#include <string_view>

#include "server/slam/filters/fastslam.h"

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 3> kFilterNames = {"fastslam2_points", "fastslam2_oriented", "fastslam1"};

}  // namespace

void Visit(OptionVisitor& visitor, FilterOptions& options) {
  VisitEnum(visitor, "filter", options.kind, kFilterNames, "What estimates path and landmarks.");
  visitor.Integer("particles", options.particles, "1", 1, 10000,
                  "More: larger loops close, in proportionally more time and memory.");
  visitor.Integer("diverged_after", options.back_end.diverged_after, "1", 1, 100000,
                  "Revisits in a row that contradict the belief before the robot counts as not localized.");
  visitor.Section("drift", "Noise of the matched motion: how far the front-end drifts.",
                  [&] { Visit(visitor, options.back_end.drift); });
  visitor.Section("landmarks", "Which features become landmarks, and when one is seen again.",
                  [&] { Visit(visitor, options.back_end.landmarks); });
  visitor.Section("fastslam", "FastSLAM, all variants.", [&] { Visit(visitor, options.fastslam); });
}

std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options, const Pose2& T_map_robot_start,
                                   std::uint64_t seed) {
  const auto fastslam = [&]<typename LandmarkModel>(Proposal proposal) -> std::unique_ptr<Filter> {
    return std::make_unique<FastSlam<LandmarkModel>>(proposal, options.fastslam, options.back_end, options.particles,
                                                     T_map_robot_start, seed);
  };
  switch (kind) {
    case FilterKind::kFastSlam2Oriented:
      return fastslam.operator()<LandmarkOriented>(Proposal::kObservation);
    case FilterKind::kFastSlam1:
      return fastslam.operator()<LandmarkPoint>(Proposal::kMotion);
    case FilterKind::kFastSlam2Points:
      break;
  }
  return fastslam.operator()<LandmarkPair>(Proposal::kObservation);
}

}  // namespace cairn::slam
