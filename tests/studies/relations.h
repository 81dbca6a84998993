// Measures how well a trajectory keeps the true motions between its poses, without aligning it. The same
// measure as tests/accuracy/relations_metric.py, in this process.
// Source: Kuemmerle et al., "On Measuring the Accuracy of SLAM Algorithms", Autonomous Robots 27(4), 2009,
// (3)-(5).
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn::studies {

struct Relation {
  Stamp from = 0;
  Stamp to = 0;
  Pose2 T_from_to;
};

// `stamp1 stamp2 x y z roll pitch yaw` a line, seconds, `#` starts a comment.
[[nodiscard]] Result<std::vector<Relation>> ReadRelations(const std::filesystem::path& path);

// The error of a trajectory in one relation.
struct RelationResidual {
  Stamp from = 0;
  Stamp to = 0;
  double trans_m = 0.0;
  double rot_deg = 0.0;
};

// The errors of the relations whose stamps the trajectory has, in order.
[[nodiscard]] std::vector<RelationResidual> ResidualsOf(const Trajectory& trajectory,
                                                        const std::vector<Relation>& relations);

struct RelationError {
  std::size_t compared = 0;
  std::size_t missing = 0;  // A stamp outside the trajectory, or in a gap of more than 2 s.
  double trans_mean_m = 0.0;
  double trans_deviation_m = 0.0;
  double trans_max_m = 0.0;
  double rot_mean_deg = 0.0;
  double rot_deviation_deg = 0.0;
  double rot_max_deg = 0.0;
};

// Means are NaN if nothing could be compared.
[[nodiscard]] RelationError ErrorOf(const Trajectory& trajectory, const std::vector<Relation>& relations);

}  // namespace cairn::studies
