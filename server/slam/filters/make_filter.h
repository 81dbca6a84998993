// The choice among the back-end filters, and their options. `slam.filter` names the one that runs; every other part of
// the estimator knows only the interface.
#pragma once

#include <cstdint>
#include <memory>

#include "common/options/option_visitor.h"
#include "server/slam/dpslam/dpslam_options.h"
#include "server/slam/filters/back_end_options.h"
#include "server/slam/filters/ekf_slam.h"
#include "server/slam/filters/fastslam_options.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/landmark_correction.h"
#include "server/slam/filters/line_localization.h"

namespace cairn::slam {

enum class FilterKind : std::uint8_t {
  kFastSlam2Points = 0,  // Thesis A 4.1-4.6, FS_2LS_2LP.
  kFastSlam2Oriented,    // Thesis A 4.7, FS_3LS_1LP.
  kFastSlam1,            // Thesis C 4.2.
  kEkf,                  // Thesis C 4.1.
  kDpSlam,               // Thesis C 3.2.3, 4.5: grid maps in the particles' family tree.
  kLandmarkCorrection,   // Thesis A 3.6.2.
  kNone,                 // The front-end's path as it is.
  kLineMatch,            // Thesis B 2.2.2: localisation in a known map of lines.
};

struct FilterOptions {
  FilterKind kind = FilterKind::kFastSlam2Points;
  std::int64_t particles = 200;  // More: larger loops close, in proportionally more time and memory.
  BackEndOptions back_end;       // Shown as slam.drift, slam.landmarks, ...
  FastSlamOptions fastslam;
  EkfOptions ekf;
  CorrectionOptions correction;
  LearntMotion motion;  // For fastslam.motion.model and dpslam.motion, in place of the `learnt` they hold.
  LocalizationOptions line_match;
  DpSlamOptions dpslam;  // `particles` counts on both levels.
};
// The fields of the `slam` section that belong to the filter.
void Visit(OptionVisitor& visitor, FilterOptions& options);

// The random engine starts from `seed`.
[[nodiscard]] std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options,
                                                 const Pose2& T_map_robot_start, std::uint64_t seed);

}  // namespace cairn::slam
