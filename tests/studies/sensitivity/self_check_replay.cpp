#include "tests/studies/sensitivity/self_check_replay.h"

#include <optional>
#include <utility>

#include "server/slam/loops/self_check.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/log_run.h"

namespace cairn::studies {

SelfCheckReplay::SelfCheckReplay(const Case& one) {
  const slam::MapperSnapshot usual = RunOverLog(one.log, one.options).snapshot;
  right_ = PathOf(usual.keyframes, slam::SmoothedPath(usual), one.options.front_end.surface);
  slam::MapperOptions none = one.options;
  none.filter.kind = slam::FilterKind::kNone;
  const slam::MapperSnapshot drifting = RunOverLog(one.log, none).snapshot;
  drifting_ = PathOf(drifting.keyframes, drifting.online_path, one.options.front_end.surface);
}

SelfCheckReplay::Path SelfCheckReplay::PathOf(const std::vector<slam::Keyframe>& keyframes, std::vector<Pose2> poses,
                                              const slam::SurfaceOptions& surface) {
  Path path{keyframes, {}, std::move(poses)};
  for (const slam::Keyframe& keyframe : keyframes)
    path.points_robot.push_back(slam::SurfacePointsOf(slam::PointsOf(*keyframe.scan), *keyframe.scan, surface));
  return path;
}

double SelfCheckReplay::ContradictedShare(const Path& path, const slam::SelfCheckOptions& options) {
  slam::SelfCheck check(options);
  slam::Trail trail{slam::MotionNoise{}};
  slam::PosePath poses;
  slam::PathIndex index;
  std::size_t contradicted = 0;
  for (std::size_t k = 0; k < path.poses.size(); ++k) {
    trail.Append(path.keyframes[k], path.poses[k], path.points_robot[k], Eigen::Matrix3d::Zero(), std::nullopt);
    poses.Append(path.poses[k]);
    index.Follow(poses);
    check.Look(trail, index);
    contradicted += check.contradicted() ? 1 : 0;
  }
  return path.poses.empty() ? 0.0 : static_cast<double>(contradicted) / static_cast<double>(path.poses.size());
}

Figures SelfCheckReplay::Measure(const slam::SelfCheckOptions& options) const {
  return {{"false alarms", ContradictedShare(right_, options)}, {"noticed", ContradictedShare(drifting_, options)}};
}

}  // namespace cairn::studies
