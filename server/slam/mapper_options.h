// All options of the estimator, nested as its parts are. The defaults are used for all logs. Visit gives the
// unit, range and meaning of each.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"
#include "common/status.h"
#include "server/slam/graph/pose_graph.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/revisit_search.h"
#include "server/slam/loops/self_check.h"
#include "server/slam/methods.h"
#include "server/slam/motion/motion_gate.h"
#include "server/slam/recovery/recovery_options.h"
#include "server/slam/scan/odometry_pairing.h"
#include "server/slam/tracking/front_end.h"
#include "server/slam/tracking/odometry_learning.h"
#include "server/slam/trail/retirement_choice.h"

namespace cairn::slam {

struct MapperOptions {
  std::int64_t seed = 1;
  double lost_after_m = 2.0;
  double max_tilt_rad = 0.035;  // Two degrees (scan/beam_points.h).
  std::int64_t max_keyframes = 500000;
  std::int64_t max_chunks = 16384;  // 0.67 km^2 at 5 cm a cell, 512 MiB.
  MotionNoise blind{0.002, 0.2, 0.0, 0.001, 0.05, 0.0};
  OdometryNoise odometry_walk;
  MatcherKind matcher = MatcherKind::kVoting;
  MatcherOptions matching;
  FrontEndOptions front_end;
  MotionGateOptions gate;
  RevisitOptions revisit;
  LoopOptions loop;
  SelfCheckOptions self_check;
  RecoveryOptions recovery{};
  PoseGraphOptions pose_graph;
  RetireOptions retire;
  FilterOptions filter;
  GridOptions grid;
  PairingOptions pairing;
  LearningOptions learning;
};
void Visit(OptionVisitor& visitor, MapperOptions& options);
// The same for a robot whose odometry is not used (tracking/README.md, Without odometry): it drifts more, so old places
// are looked for farther off. A matcher that was chosen instead of the default stays.
[[nodiscard]] MapperOptions ForScansAlone(MapperOptions options);
// Checks the rules between fields that Visit declares. The error names both keys as in a configuration file,
// beginning with `slam.`.
[[nodiscard]] Result<void> Validate(const MapperOptions& options);

}  // namespace cairn::slam
