// Every option of the estimator, nested as the code is. Defaults serve all logs; Visit names unit, range, meaning.
#pragma once

#include <cstdint>

#include "common/options/option_visitor.h"
#include "server/slam/filters/make_filter.h"
#include "server/slam/front_end.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/matching/loop_search.h"
#include "server/slam/matching/revisit_search.h"
#include "server/slam/matching/scan_matching.h"
#include "server/slam/matching/self_check.h"
#include "server/slam/motion/motion_gate.h"
#include "server/slam/scan/odometry_pairing.h"
#include "server/slam/smoothing/pose_graph.h"

namespace cairn::slam {

struct MapperOptions {
  std::int64_t seed = 1;        // Of every robot's random engine: the same robot alone or in a fleet maps alike.
  double lost_after_m = 2.0;    // Travelled by odometry alone before the robot counts as lost.
  double max_tilt_rad = 0.035;  // Two degrees; scans tilted further get a pose but are not evidence (scan/tilt.h).
  MotionNoise blind{0.002, 0.2, 0.0, 0.001, 0.05, 0.0};  // Of motion known by odometry alone, besides the drift.
  MatcherKind matcher = MatcherKind::kVoting;            // What compares a scan with the last keyframe.
  MatcherOptions matching;
  FrontEndOptions front_end;
  MotionGateOptions gate;
  RevisitOptions revisit;
  LoopOptions loop;
  SelfCheckOptions self_check;
  PoseGraphOptions pose_graph;
  FilterOptions filter;
  GridOptions grid;
  PairingOptions pairing;
};
void Visit(OptionVisitor& visitor, MapperOptions& options);

}  // namespace cairn::slam
