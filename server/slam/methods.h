// All methods that a configuration can choose: the scan matchers (`slam.matcher`) and the back-end filters
// (`slam.filter`), their options, and the functions that make them. This is the only file that includes them
// all; the rest of the estimator uses the interfaces ScanMatcher and Filter. README.md explains how to add
// one.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "common/options/option_visitor.h"
#include "server/slam/dpslam/dpslam_options.h"
#include "server/slam/ekf/ekf_slam.h"
#include "server/slam/fastslam/particle_set.h"
#include "server/slam/filters/filter.h"
#include "server/slam/localisation/line_localization.h"
#include "server/slam/matchers/correlative.h"
#include "server/slam/matchers/hough.h"
#include "server/slam/matchers/icp.h"
#include "server/slam/matchers/line_lsq.h"
#include "server/slam/matchers/ndt.h"
#include "server/slam/matchers/ndt_de.h"
#include "server/slam/matching/scan_matcher.h"
#include "server/slam/motion_models/motion_sampling.h"
#include "server/slam/reckoning/landmark_correction.h"
#include "server/slam/voting/voting.h"

namespace cairn::slam {

enum class MatcherKind : std::uint8_t { kVoting = 0, kLineLsq, kHough, kNdt, kNdtDe, kIcp, kCorrelative };
// The names in the order of the enum.
[[nodiscard]] std::span<const std::string_view> MatcherNames();
[[nodiscard]] std::string_view MatcherName(MatcherKind kind);

struct MatcherOptions {
  VotingOptions voting;
  NdtOptions ndt;
  NdtDeOptions ndt_de;
  LineLsqOptions line_lsq;
  HoughOptions hough;
  PointToLineOptions icp;
  CorrelativeOptions correlative;
};
void Visit(OptionVisitor& visitor, MatcherOptions& options);

[[nodiscard]] ScanMatcher MakeMatcher(MatcherKind kind, const MatcherOptions& options);

enum class FilterKind : std::uint8_t {
  kFastSlam2Points = 0,  // Thesis A 4.1-4.6, FS_2LS_2LP.
  kFastSlam2Oriented,    // Thesis A 4.7, FS_3LS_1LP.
  kFastSlam1,            // Thesis C 4.2.
  kEkf,                  // Thesis C 4.1.
  kDpSlam,               // Thesis C 3.2.3, 4.5: particles with grid maps.
  kLandmarkCorrection,   // Thesis A 3.6.2.
  kNone,                 // The front-end's path without correction.
  kLineMatch,            // Thesis B 2.2.2: localisation in a known map of lines.
};

struct FilterOptions {
  FilterKind kind = FilterKind::kFastSlam2Points;
  std::int64_t particles = 200;
  // In the configuration: slam.drift, slam.landmarks, slam.diverged_after.
  BackEndOptions back_end;
  FastSlamOptions fastslam;
  MotionSampling sampling;  // How FastSLAM 1.0 samples a step; in the configuration: slam.fastslam.motion.
  EkfOptions ekf;
  CorrectionOptions correction;
  LearntMotion motion;  // Replaces the `learnt` of fastslam.motion and dpslam.
  LocalizationOptions line_match;
  DpSlamOptions dpslam;  // The field `particles` above applies to both levels.
};
// Visits the fields of the `slam` section that belong to the filter.
void Visit(OptionVisitor& visitor, FilterOptions& options);

// The random engine starts from `seed`.
[[nodiscard]] std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options,
                                                 const Pose2& T_map_robot_start, std::uint64_t seed);

}  // namespace cairn::slam
