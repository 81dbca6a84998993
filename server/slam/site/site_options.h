// What the joint smoothing takes over from the options of the estimator, so that a place is judged alike everywhere.
#pragma once

#include "server/slam/graph/pose_graph.h"
#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/revisit_search.h"
#include "server/slam/loops/self_check.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/recovery/recovery_options.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

struct SiteOptions {
  LoopOptions loop;
  RevisitOptions revisit;
  PlaceSearchOptions place;
  SelfCheckOptions self_check;
  PointToLineOptions align;
  SurfaceOptions surface;
  MotionNoise drift;  // Of matched steps.
  PoseGraphOptions pose_graph;
};

}  // namespace cairn::slam
