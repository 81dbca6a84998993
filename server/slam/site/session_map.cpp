#include "server/slam/site/session_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <utility>

#include "server/slam/loops/region.h"

namespace cairn::slam {

namespace {

// A session is compared with all of another one, and with all of itself: a place proves nothing if another one anywhere
// looks the same. A robot looks for itself in the map around it, and this is around the middle of the path. Of a larger
// session, what lies farther out is not searched: the search of one that is wider than 575 m would reach its bound
// on work (kMaxBlocks), and find nothing.
constexpr double kMostReachM = 280.0;

Eigen::Vector2d MiddleOf(const std::vector<Pose2>& path) {
  Eigen::AlignedBox2d box;
  for (const Pose2& pose : path) box.extend(pose.translation());
  return path.empty() ? Eigen::Vector2d::Zero().eval() : box.center().eval();
}

PlaceSearchOptions WithReach(PlaceSearchOptions options) {
  options.map_reach_m = kMostReachM;
  return options;
}

// The steps alone, for a session in which no place was seen again: its snapshot has no relations then.
std::vector<PoseRelation> StepsAlong(const std::vector<Pose2>& path, const MotionNoise& drift) {
  std::vector<PoseRelation> steps;
  for (std::size_t k = 1; k < path.size(); ++k) {
    const Pose2 step = Between(path[k - 1], path[k]);
    steps.push_back({k - 1, k, step, drift.Covariance(step) + 1e-10 * Eigen::Matrix3d::Identity(), false});
  }
  return steps;
}

std::vector<PoseRelation> MeasuredIn(const MapperSnapshot& snapshot, const std::vector<Pose2>& path,
                                     const MotionNoise& drift) {
  if (!snapshot.relations.empty()) return snapshot.relations;
  return snapshot.steps.empty() ? StepsAlong(path, drift) : snapshot.steps;
}

}  // namespace

SessionMap::SessionMap(std::uint64_t session, const MapperSnapshot& snapshot, std::vector<Pose2> own_path,
                       const SiteOptions& options)
    : session_(session),
      relations_(MeasuredIn(snapshot, own_path, options.drift)),
      own_path_(std::move(own_path)),
      trail_(MotionNoise{}, options.surface),
      place_(WithReach(options.place)),
      middle_(MiddleOf(own_path_)),
      near_m_(options.self_check.near_m),
      places_(options.place, options.loop, options.self_check, options.align) {
  for (std::size_t k = 0; k < own_path_.size(); ++k) {
    // Most keyframes are not looked at again: what they show of the others is in the book.
    trail_.Append(snapshot.keyframes[k], own_path_[k], std::nullopt, Eigen::Matrix3d::Zero(), std::nullopt);
    shared_own_path_.Append(own_path_[k]);
    ids_.push_back({snapshot.numbers.empty() ? k : snapshot.numbers[k], snapshot.keyframes[k].scan.stamp()});
  }
}

std::optional<std::size_t> SessionMap::IndexOf(const KeyframeId& id) const {
  const auto found = std::ranges::lower_bound(ids_, id.number, {}, &KeyframeId::number);
  if (found == ids_.end() || !(*found == id)) return std::nullopt;
  return static_cast<std::size_t>(found - ids_.begin());
}

std::size_t SessionMap::LastAround(std::size_t keyframe, double way_m) const {
  std::size_t last = StretchAround(trail_.shapes(), keyframe, way_m).last;
  while (last > keyframe && !localized(last)) --last;
  return last;
}

std::vector<RecentScan> SessionMap::ScansAround(std::size_t keyframe, double way_m) const {
  const Stretch stretch = StretchAround(trail_.shapes(), keyframe, way_m);
  std::vector<RecentScan> scans;
  for (std::size_t k = stretch.first; k <= stretch.last; ++k)
    if (localized(k))
      scans.push_back({trail_.keyframes()[k].scan.Share(), own_path_[k], travelled_m(k), *trail_.points(k)});
  return scans;
}

std::optional<FoundPlace> SessionMap::Find(std::span<const RecentScan> scans) {
  // Most places are not in the other map. To find out that no pose is likely enough takes a fraction of the time in
  // which the best pose is found. Places that were accepted had a likelihood of 0.74 and more.
  constexpr double kLeastLikelihood = 0.7;
  constexpr Pose2 kNowhere{1e6, 1e6, 0.0};
  if (!places_.FitsElsewhere(map(), scans, kNowhere, kLeastLikelihood)) return std::nullopt;
  return places_.Find(map(), scans);
}

std::size_t SessionMap::NearestTo(const Pose2& T_own_robot) const {
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < size(); ++k) {
    const double away = (own_path_[k].translation() - T_own_robot.translation()).norm() +
                        std::abs(AngleDiff(own_path_[k].theta, T_own_robot.theta));
    if (!localized(k) || away >= least) continue;
    least = away;
    nearest = k;
  }
  return nearest;
}

}  // namespace cairn::slam
