// The same fit as OptimisePoses (pose_graph.h) for the scan that closes a large loop, whose pose a robot waits for.
// Most nodes of a path have no loop: only their two steps are relations of them. Such a run of steps becomes one
// relation between its two ends, the ends and all loops are fitted, and then each run takes up the difference at its
// ends, every step according to its covariance. That is the least-squares answer for a chain as far as the errors are
// linear; what is lost is of second order in the correction within a run. Stateless, thread-safe, deterministic.
// Source: Lu and Milios 1997 (serial composition of relations, 4.2); marginalisation of a chain.
#pragma once

#include <span>
#include <vector>

#include "server/slam/graph/pose_graph.h"

namespace cairn::slam {

// As OptimisePoses(poses, relations, options), but the costs in the answer are those of the ends of the runs.
// REQUIRES: the indices of all relations lie within poses.
PoseGraphSummary OptimiseLoopGraph(std::vector<Pose2>& poses, std::span<const PoseRelation> relations,
                                   const PoseGraphOptions& options);

}  // namespace cairn::slam
