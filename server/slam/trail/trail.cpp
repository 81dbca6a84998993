#include "server/slam/trail/trail.h"

#include <utility>

namespace cairn::slam {

void Trail::Append(Keyframe keyframe, const Pose2& T_track_robot, std::vector<SurfacePoint> points_robot,
                   const Eigen::Matrix3d& step_covariance, const std::optional<RevisitObservation>& revisit) {
  graph_.Append(FromLast(T_track_robot), step_covariance);
  if (revisit) graph_.AddLoop(revisit->keyframe, size(), revisit->T_keyframe_robot, revisit->covariance);
  shapes_.push_back({T_track_robot, TravelledTo(T_track_robot), std::move(points_robot)});
  keyframes_.push_back(std::move(keyframe));
  distances_m_ = graph_.DistancesFromLast();
}

void Trail::JudgeLast(bool localized, bool on_the_path) {
  keyframes_.back().localized = localized;
  keyframes_.back().doubted = !localized && on_the_path;
}

void Trail::TrustDoubted() {
  keyframes_ = TrustedKeyframes();
}

std::vector<Keyframe> Trail::TrustedKeyframes() const {
  std::vector<Keyframe> trusted = keyframes_;
  for (Keyframe& keyframe : trusted) {
    keyframe.localized = keyframe.localized || keyframe.doubted;
    keyframe.doubted = false;
  }
  return trusted;
}

void Trail::RestorePoints(const SurfaceOptions& options, const ParallelFor& parallel_for) {
  parallel_for(static_cast<int>(size()), [&](int begin, int end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      const Scan& scan = *keyframes_[k].scan;
      shapes_[k].points = SurfacePointsOf(PointsOf(scan), scan, options);
    }
  });
  distances_m_ = graph_.DistancesFromLast();
}

void Trail::AddScan(Stamp stamp, const Pose2& T_keyframe_robot) {
  scans_.push_back({stamp, size() - 1, T_keyframe_robot});
}

void Trail::AddLoop(const PoseRelation& loop) {
  graph_.AddLoop(loop.from, loop.to, loop.T_from_to, loop.covariance);
  distances_m_ = graph_.DistancesFromLast();
}

std::optional<std::vector<Pose2>> Trail::PathWithLoop(const PoseRelation& loop, std::vector<Pose2> path,
                                                      const PoseGraphOptions& options) const {
  KeyframeGraph closed = graph_;
  closed.AddLoop(loop.from, loop.to, loop.T_from_to, loop.covariance);
  if (!closed.Optimise(path, options).usable) return std::nullopt;
  return path;
}

Pose2 Trail::FromLast(const Pose2& T_track_robot) const {
  return empty() ? Pose2{} : Between(shapes_.back().T_track_robot, T_track_robot);
}

double Trail::TravelledTo(const Pose2& T_track_robot) const {
  return empty() ? 0.0 : shapes_.back().travelled_m + FromLast(T_track_robot).translation().norm();
}

std::vector<PoseRelation> Trail::relations() const {
  return graph_.has_loops() ? graph_.relations() : std::vector<PoseRelation>{};
}

}  // namespace cairn::slam
