// The relations between the keyframes of one robot: the motion from each keyframe to the next, and the
// relative poses of keyframes whose place was seen again (loops). It gives the distance between two keyframes
// along the graph, which bounds the error of their relative pose, and the path that fits all relations best.
// Node k is keyframe k. Not thread-safe.
// Source: Lu and Milios 1997; distance along the graph as a measure of uncertainty: Bosse et al. 2004
// (Atlas).
#pragma once

#include <vector>

#include "server/slam/graph/pose_graph.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

class KeyframeGraph {
 public:
  // `drift` gives the covariance of a matched step.
  explicit KeyframeGraph(const MotionNoise& drift) : drift_(drift) {}

  // Adds the next keyframe. `T_prev_curr` is its pose relative to the keyframe before. `covariance_prev` is
  // the covariance of that step, in the frame in which it starts, in addition to the drift. Both are ignored
  // for the first keyframe.
  void Append(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // Adds a loop: keyframe `to` was recognised from keyframe `from`. REQUIRES: both exist.
  void AddLoop(std::size_t from, std::size_t to, const Pose2& T_from_to, const Eigen::Matrix3d& covariance);

  [[nodiscard]] std::size_t size() const { return travelled_m_.size(); }
  // Length of the shortest path through the graph from the last keyframe to each keyframe, in metres.
  [[nodiscard]] std::vector<double> DistancesFromLast() const;
  // Moves `path` (one pose per keyframe) to the path that fits all relations best. The search starts at the
  // given poses, and keyframe 0 stays where it is. The result contains whether the new path is usable.
  PoseGraphSummary Optimise(std::vector<Pose2>& path, const PoseGraphOptions& options) const {
    return OptimisePoses(path, relations_, options);
  }
  [[nodiscard]] bool has_loops() const { return size() > 0 && relations_.size() + 1 > size(); }
  [[nodiscard]] const std::vector<PoseRelation>& relations() const { return relations_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.relations_, self.travelled_m_, self.loops_);
    const std::size_t size = self.size();
    bool sound = self.loops_.size() == size;
    for (const PoseRelation& relation : self.relations_) sound = sound && relation.from < size && relation.to < size;
    for (const auto& loops : self.loops_)
      for (const Loop& loop : loops) sound = sound && loop.other < size && loop.way_m >= 0.0;
    archive.Require(sound, "the relations between keyframes");
  }

 private:
  struct Loop {
    std::size_t other = 0;
    double way_m = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.other, self.way_m);
    }
  };

  MotionNoise drift_;
  std::vector<PoseRelation> relations_;
  std::vector<double> travelled_m_;  // Per keyframe: distance along the chain of steps.
  // Per keyframe: its loops. Each loop is stored at both of its keyframes.
  std::vector<std::vector<Loop>> loops_;
};

}  // namespace cairn::slam
