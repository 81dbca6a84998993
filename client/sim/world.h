// A simulated building seen from above: straight walls, round obstacles that stand or walk, and routes for robots.
// Not a physics world: nothing is pushed, and walls have no height. Frame: `map`, metres. Plain value.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "common/geometry/angle.h"

namespace cairn::sim {

struct Segment {
  Eigen::Vector2d a_map;
  Eigen::Vector2d b_map;
};

struct Disc {
  Eigen::Vector2d center_map;
  double radius_m = 0.0;
};

// A disc (a person) that walks along a closed path for ever.
struct Walker {
  double radius_m = 0.0;
  double speed_m_s = 0.0;
  std::vector<Eigen::Vector2d> path_map;  // At least 2 points; from the last back to the first.
};

// A sliding door: closed for a while, then open for a while, and so on. A closed one is a leaf between two points; an
// open one is not there.
struct Door {
  Eigen::Vector2d a_map;
  Eigen::Vector2d b_map;
  double closed_s = 0.0;
  double open_s = 0.0;
  double begin_s = 0.0;  // How long before the beginning it was closed.
};

// How far from its normal a pane still returns a beam: assumed, since makers of lidars do not state it.
inline constexpr double kDefaultSeenRad = Radians(10.0);
// A pane of glass without thickness. A beam that meets it within `seen_rad` of its normal returns from it. A more
// oblique one goes through, and one beyond kMirrorRad is mirrored. Frame: `map`.
struct Pane {
  Eigen::Vector2d a_map;
  Eigen::Vector2d b_map;
  double seen_rad = kDefaultSeenRad;
};
// Where a pane reflects half of the light and lets the other half through: Fresnel's equations for two surfaces of
// refractive index 1.5 and unpolarised light. A lidar that reports the strongest return sees the mirrored wall from
// there on.
inline constexpr double kMirrorRad = Radians(79.0);

// Waypoints a robot drives in a circle: at least 2, from the last back to the first.
struct Route {
  std::string name;
  std::vector<Eigen::Vector2d> waypoints_map;
};

struct World {
  std::string name;
  std::vector<Segment> segments;
  std::vector<Disc> discs;
  std::vector<Walker> walkers;
  std::vector<Door> doors;
  std::vector<Pane> panes;
  std::vector<Route> routes;
};

// Where a walker stands after `seconds` (>= 0). It starts at the first point of its path.
[[nodiscard]] Disc WalkerAt(const Walker& walker, double seconds);

// Whether the door is closed after `seconds` (>= 0).
[[nodiscard]] bool IsClosed(const Door& door, double seconds);
// From the leaf of a closed door.
[[nodiscard]] double DistanceFrom(const Door& door, const Eigen::Vector2d& p_map);
// Adds the leaf: discs that overlap, 8 cm thick.
void AppendLeaf(const Door& door, std::vector<Disc>* discs);

// A closed polyline measured by the distance along it. Walkers walk on one, and the starts of robots are spread over
// one.
[[nodiscard]] double ClosedLength(const std::vector<Eigen::Vector2d>& points);

struct PathPlace {
  Eigen::Vector2d p_map = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;  // Towards the next point.
  std::size_t next = 0;      // Index of the next point.
};

// `way_m` from the first point, taken modulo the length. Needs two points and a length above zero.
[[nodiscard]] PathPlace PlaceOnPath(const std::vector<Eigen::Vector2d>& points, double way_m);

// A wall with a thickness and doorways: the solid strip around a centre line, cut where its gaps are.
// The strip reaches half a thickness beyond both ends, so walls that share an end close the corner.
struct WallGap {
  double from_m = 0.0;  // Along the centre line, from its first end.
  double to_m = 0.0;
};

struct Wall {
  Eigen::Vector2d a_map;
  Eigen::Vector2d b_map;
  double thickness_m = 0.12;
  std::vector<WallGap> gaps;  // In order, apart, within the wall.
};

// Adds the outlines of the wall's solid pieces. The ends must differ.
void AppendWall(const Wall& wall, std::vector<Segment>* segments);

}  // namespace cairn::sim
