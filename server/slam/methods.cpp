#include "server/slam/methods.h"

#include <array>
#include <string_view>
#include <utility>

#include "server/slam/dpslam/dpslam.h"
#include "server/slam/fastslam/fastslam.h"
#include "server/slam/landmark_variants/landmark_oriented.h"
#include "server/slam/landmark_variants/landmark_point.h"
#include "server/slam/landmarks/landmark_pair.h"
#include "server/slam/reckoning/dead_reckoning_filter.h"

namespace cairn::slam {
namespace {

constexpr auto kMatcherNames =
    std::to_array<std::string_view>({"voting", "line_lsq", "hough", "ndt", "ndt_de", "icp", "correlative"});
constexpr auto kFilterNames =
    std::to_array<std::string_view>({"fastslam2_points", "fastslam2_oriented", "fastslam1", "ekf", "dpslam",
                                     "landmark_correction", "none", "line_match"});

// The motion sampler of FastSLAM 1.0: its input from the step, and how it samples.
MotionSampler SamplerOf(const FilterOptions& options) {
  MotionSampling sampling = options.sampling;
  sampling.learnt = options.motion;
  return {.input = [model = sampling.model](const StepMotion& measured) { return InputOf(model, measured); },
          .draw = [sampling](const Pose2& T_map_robot, const StepMotion& step,
                             Rng& rng) { return SampleMotion(T_map_robot, step, sampling, rng); }};
}

}  // namespace

std::span<const std::string_view> MatcherNames() {
  return kMatcherNames;
}

std::string_view MatcherName(MatcherKind kind) {
  return kMatcherNames[static_cast<std::size_t>(kind)];
}

void Visit(OptionVisitor& visitor, MatcherOptions& options) {
  visitor.Section("voting", "Seven criteria vote for pairs of lines.", [&] { Visit(visitor, options.voting); });
  visitor.Section("ndt", "Normal distributions transform with Newton's method.", [&] { Visit(visitor, options.ndt); });
  visitor.Section("ndt_de", "Normal distributions transform with differential evolution.",
                  [&] { Visit(visitor, options.ndt_de); });
  visitor.Section("line_lsq", "Least squares over pairs of lines.", [&] { Visit(visitor, options.line_lsq); });
  visitor.Section("hough", "Correlation in the Hough domain.", [&] { Visit(visitor, options.hough); });
  visitor.Section("icp", "Points against surfaces of the last scan.", [&] { Visit(visitor, options.icp); });
  visitor.Section("correlative", "All motions in a window.", [&] { Visit(visitor, options.correlative); });
}

ScanMatcher MakeMatcher(MatcherKind kind, const MatcherOptions& options) {
  using View = const ScanView&;
  using Prior = const MatchPrior&;
  using Parallel = const ParallelFor&;
  switch (kind) {
    case MatcherKind::kLineLsq:
      return {.match = [o = options.line_lsq](View ref, View curr, Prior prior, Parallel) {
        return MatchByLineLsq(ref.features, curr.features, prior, o);
      }};
    case MatcherKind::kHough:
      return {.match = [o = options.hough](View ref, View curr, Prior prior,
                                           Parallel parallel) { return MatchByHough(ref, curr, prior, o, parallel); },
              .searches_wide = true};
    case MatcherKind::kNdt:
      return {.match = [o = options.ndt](View ref, View curr, Prior prior, Parallel parallel) {
        return MatchByNdt(ref, curr, prior, o, parallel);
      }};
    case MatcherKind::kNdtDe:
      return {.match = [o = options.ndt_de](
                           View ref, View curr, Prior prior,
                           Parallel parallel) { return MatchByDifferentialEvolution(ref, curr, prior, o, parallel); },
              .searches_wide = true};
    case MatcherKind::kIcp:
      return {.match = [o = options.icp](View ref, View curr, Prior prior,
                                         Parallel) { return MatchByIcp(ref, curr, prior, o); },
              .keeps_reference = true};
    case MatcherKind::kCorrelative:
      return {.match = [o = options.correlative](
                           View ref, View curr, Prior prior,
                           Parallel parallel) { return MatchByCorrelation(ref, curr, prior, o, parallel); },
              .keeps_reference = true};
    case MatcherKind::kVoting:
      break;
  }
  return {.match = [o = options.voting](View ref, View curr, Prior prior, Parallel) {
    return MatchByVoting(ref.features, curr.features, prior.T_ref_curr, o);
  }};
}

void Visit(OptionVisitor& visitor, FilterOptions& options) {
  VisitEnum(visitor, "filter", options.kind, kFilterNames,
            ForOperators("The method that estimates the path and the landmarks. `none` takes the path of the tracking "
                         "as it is; line_match localises in a known map."));
  visitor.Integer("particles", options.particles, "1", 1, 10000,
                  ForOperators("Number of particles of FastSLAM and DP-SLAM. More particles close larger loops, and "
                               "take proportionally more time and memory."));
  visitor.Integer(
      "diverged_after", options.back_end.diverged_after, "1", 1, 100000,
      "Number of revisits in a row that contradict the estimate after which the robot counts as not localized.");
  visitor.Section("drift", "Uncertainty of the motion that the tracking measures.",
                  [&] { Visit(visitor, options.back_end.drift); });
  visitor.Section("motion",
                  "Motion models that `cairn-calibrate motion` has learnt. They are used where fastslam.motion.model "
                  "or dpslam.motion names them.",
                  [&] { Visit(visitor, options.motion); });
  visitor.Section("landmarks", "Which features become landmarks, and how they are recognised.",
                  [&] { Visit(visitor, options.back_end.landmarks); });
  visitor.Section("fastslam", "All variants of FastSLAM.", [&] {
    Visit(visitor, options.fastslam);
    visitor.Section("motion", "How FastSLAM 1.0 draws the motion of a step.",
                    [&] { Visit(visitor, options.sampling); });
  });
  visitor.Section("correction",
                  "The filter landmark_correction, which corrects the pose by a landmark that is seen again.",
                  [&] { Visit(visitor, options.correction); });
  visitor.Section("line_match", "Localisation in a known map of lines, for the filter line_match.",
                  [&] { Visit(visitor, options.line_match); });
  visitor.Section("ekf", "EKF-SLAM.", [&] { Visit(visitor, options.ekf); });
  visitor.Section("dpslam", "DP-SLAM.", [&] { Visit(visitor, options.dpslam); });
  visitor.Require(options.kind != FilterKind::kLandmarkCorrection || options.back_end.landmarks.enabled, "filter",
                  "has nothing to correct by without", "landmarks.enabled");
  visitor.Require(options.kind != FilterKind::kDpSlam || options.dpslam.segment.trajectories <= options.particles,
                  "dpslam.segment.trajectories", "must not exceed", "particles");
}

std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options, const Pose2& T_map_robot_start,
                                   std::uint64_t seed) {
  const auto make_fastslam = [&]<typename LandmarkModel>(MotionSampler sampler) -> std::unique_ptr<Filter> {
    return std::make_unique<FastSlam<LandmarkModel>>(options.fastslam, options.back_end, options.particles,
                                                     T_map_robot_start, seed, std::move(sampler));
  };
  switch (kind) {
    case FilterKind::kFastSlam2Oriented:
      return make_fastslam.operator()<LandmarkOriented>({});
    case FilterKind::kFastSlam1:
      return make_fastslam.operator()<LandmarkPoint>(SamplerOf(options));
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
  return make_fastslam.operator()<LandmarkPair>({});
}

}  // namespace cairn::slam
