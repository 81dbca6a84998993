// What is known between the keyframes of one robot: how it moved from each to the next, and which it saw again from
// where. Tells how far apart two keyframes are along what is known, which bounds how far wrong their relation can be,
// and the path that fits everything best. Node k is keyframe k. Not thread-safe.
// Source: Lu and Milios 1997; distances along the graph as a measure of doubt: Bosse et al. 2004 (Atlas).
#pragma once

#include <vector>

#include "server/slam/motion/motion_noise.h"
#include "server/slam/smoothing/pose_graph.h"

namespace cairn::slam {

class KeyframeGraph {
 public:
  // `drift` is how far a matched step is trusted.
  explicit KeyframeGraph(const MotionNoise& drift) : drift_(drift) {}

  // The next keyframe, seen from the one before (ignored for the first). `covariance_prev`: of the step, in the frame
  // it starts from, besides the drift.
  void Append(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // Keyframe `to` was recognised from keyframe `from`. REQUIRES: both exist.
  void AddLoop(std::size_t from, std::size_t to, const Pose2& T_from_to, const Eigen::Matrix3d& covariance);

  [[nodiscard]] std::size_t size() const { return travelled_m_.size(); }
  // Metres along the shortest way through the graph from the last keyframe to each.
  [[nodiscard]] std::vector<double> DistancesFromLast() const;
  // The best path, starting the search at `path` (one pose per keyframe); keyframe 0 stays. Answers whether it is
  // usable.
  PoseGraphSummary Optimise(std::vector<Pose2>& path, const PoseGraphOptions& options) const {
    return OptimisePoses(path, relations_, options);
  }
  [[nodiscard]] bool has_loops() const { return size() > 0 && relations_.size() + 1 > size(); }
  [[nodiscard]] const std::vector<PoseRelation>& relations() const { return relations_; }

 private:
  struct Loop {
    std::size_t other = 0;
    double way_m = 0.0;
  };

  MotionNoise drift_;
  std::vector<PoseRelation> relations_;
  std::vector<double> travelled_m_;       // Per keyframe, along the chain.
  std::vector<std::vector<Loop>> loops_;  // Per keyframe, both ways.
};

}  // namespace cairn::slam
