// The choice among the back-end filters, and their options. `slam.filter` names the one that runs; every other part of
// the estimator knows only the interface.
#pragma once

#include <cstdint>
#include <memory>

#include "common/options/option_visitor.h"
#include "server/slam/filters/fastslam2.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/landmark_tracker.h"

namespace cairn::slam {

enum class FilterKind : std::uint8_t {
  kFastSlam2Points = 0,  // Thesis A 4.1-4.6, FS_2LS_2LP.
};

struct FilterOptions {
  FilterKind kind = FilterKind::kFastSlam2Points;
  std::int64_t particles = 200;  // More: larger loops close, in proportionally more time and memory.
  LandmarkOptions landmarks;
  FastSlamOptions fastslam;
};
// The fields of the `slam` section that belong to the filter.
void Visit(OptionVisitor& visitor, FilterOptions& options);

// The random engine starts from `seed`.
[[nodiscard]] std::unique_ptr<Filter> MakeFilter(FilterKind kind, const FilterOptions& options,
                                                 const Pose2& T_map_robot_start, std::uint64_t seed);

}  // namespace cairn::slam
