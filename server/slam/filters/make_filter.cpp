#include "server/slam/filters/make_filter.h"

#include <array>
#include <string_view>

#include "server/slam/dpslam/dpslam.h"
#include "server/slam/filters/dead_reckoning_filter.h"
#include "server/slam/filters/fastslam.h"

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 8> kFilterNames = {
    "fastslam2_points", "fastslam2_oriented",  "fastslam1", "ekf",
    "dpslam",           "landmark_correction", "none",      "line_match"};

}  // namespace

void Visit(OptionVisitor& visitor, FilterOptions& options) {
  VisitEnum(visitor, "filter", options.kind, kFilterNames, "What estimates path and landmarks.");
  visitor.Integer("particles", options.particles, "1", 1, 10000,
                  "More: larger loops close, in proportionally more time and memory.");
  visitor.Real("max_nis", options.back_end.max_nis, "1", 1.0, 1000.0,
               "Squared Mahalanobis distance beyond which an observation adds no more doubt.");
  visitor.Integer("diverged_after", options.back_end.diverged_after, "1", 1, 100000,
                  "Revisits in a row that contradict the belief before the robot counts as not localized.");
  visitor.Section("drift", "Noise of the matched motion: how far the front-end drifts.",
                  [&] { Visit(visitor, options.back_end.drift); });
  visitor.Section("motion", "What cairn-calibrate motion learnt, for fastslam.motion.model and dpslam.motion.",
                  [&] { Visit(visitor, options.motion); });
  visitor.Section("landmarks", "Which features become landmarks, and when one is seen again.",
                  [&] { Visit(visitor, options.back_end.landmarks); });
  visitor.Section("fastslam", "FastSLAM, all variants.", [&] { Visit(visitor, options.fastslam); });
  visitor.Section("correction", "landmark_correction: deterministic global localisation.",
                  [&] { Visit(visitor, options.correction); });
  visitor.Section("line_match", "line_match: localisation in a known map of lines.",
                  [&] { Visit(visitor, options.line_match); });
  visitor.Section("ekf", "EKF-SLAM.", [&] { Visit(visitor, options.ekf); });
  visitor.Section("dpslam", "DP-SLAM.", [&] { Visit(visitor, options.dpslam); });
}

std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options, const Pose2& T_map_robot_start,
                                   std::uint64_t seed) {
  const auto make_fastslam = [&]<typename LandmarkModel>(Proposal proposal) -> std::unique_ptr<Filter> {
    FastSlamOptions fastslam = options.fastslam;
    fastslam.motion.learnt = options.motion;
    return std::make_unique<FastSlam<LandmarkModel>>(proposal, fastslam, options.back_end, options.particles,
                                                     T_map_robot_start, seed);
  };
  switch (kind) {
    case FilterKind::kFastSlam2Oriented:
      return make_fastslam.operator()<LandmarkOriented>(Proposal::kObservation);
    case FilterKind::kFastSlam1:
      return make_fastslam.operator()<LandmarkPoint>(Proposal::kMotion);
    case FilterKind::kEkf:
      return std::make_unique<EkfSlam>(options.ekf, options.back_end, T_map_robot_start);
    case FilterKind::kDpSlam: {
      DpSlamOptions dpslam = options.dpslam;
      dpslam.low.particles = dpslam.high.particles = options.particles;
      dpslam.learnt = options.motion;
      return std::make_unique<DpSlam>(dpslam, T_map_robot_start, seed);
    }
    case FilterKind::kLandmarkCorrection:
      return std::make_unique<LandmarkCorrection>(options.correction, options.back_end, T_map_robot_start);
    case FilterKind::kNone:
      return std::make_unique<DeadReckoningFilter>(options.back_end, T_map_robot_start);
    case FilterKind::kLineMatch:
      return std::make_unique<LineLocalization>(options.line_match, options.back_end, T_map_robot_start);
    case FilterKind::kFastSlam2Points:
      break;
  }
  return make_fastslam.operator()<LandmarkPair>(Proposal::kObservation);
}

}  // namespace cairn::slam
