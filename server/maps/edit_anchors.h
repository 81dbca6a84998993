// How an edit of a map moves with the map. When it is made, each of its points hangs on the nearest keyframe that sees
// it, of those sessions that have drawn the tile in which the point lies. Where these keyframes lie elsewhere later,
// because a large loop, a job or a switch of the map version has bent the map, the edit moves with them: as a whole,
// without changing its shape. Points and poses are in the map frame. Stateless functions; thread-safe.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <vector>

#include "common/map/map_edit.h"
#include "server/maps/robot_grid.h"
#include "server/store/records.h"

namespace cairn::server {

using DrawnPaths = std::map<SessionId, DrawnPath>;

// Which keyframes count for a point: those of these sessions; and of near ones those from which it is seen come first,
// because a keyframe behind a wall may have been drawn at another time, and may move otherwise.
struct AnchorChoice {
  std::function<std::vector<SessionId>(const Eigen::Vector2d& point)> sessions_at;
  std::function<bool(const Eigen::Vector2d& from, const Eigen::Vector2d& point)> sees;
};
// What the edit hangs on, where it lies now. Without keyframes: there are none for any of its points.
[[nodiscard]] EditAnchors AnchorsOf(const MapEdit& edit, const DrawnPaths& paths, const AnchorChoice& choice);

// T_now_then: the rigid motion that is nearest, in the sense of least squares, to that of all its points. Each point
// moves with the nearest of the keyframes on which the edit hangs, whether or not that one sees it. Exactly the
// identity where the keyframes lie where they were. REQUIRES: there are points and keyframes. Source: the fit of two
// sets of points in the plane (Umeyama 1991, without a scale).
[[nodiscard]] Pose2 MotionOf(const EditAnchors& anchors);

// The poses before, of those keyframes that there are afterwards, too.
[[nodiscard]] DrawnPath PosesBefore(const DrawnPath& before, const DrawnPath& after);

}  // namespace cairn::server
