#include "client/sim/scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::sim {
namespace {

constexpr double kUpright = 1e-9;  // Horizontal share of a direction below which it has no shadow.
constexpr double kOffPaneM = 1e-6;

// The angle between the ray and the pane's normal, 0..pi/2.
double IncidenceOn(const Pane& pane, const Eigen::Vector2d& direction) {
  const Eigen::Vector2d along = (pane.b_map - pane.a_map).normalized();
  return std::asin(std::min(1.0, std::abs(along.dot(direction))));
}

}  // namespace

double FlatScene::Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction, double max_m) const {
  const Eigen::Vector2d origin = origin_map.head<2>(), shadow = direction.head<2>();
  if (direction.z() == 0.0) return CastInPlane(origin, shadow, max_m);  // Exactly as in the plane.
  const double share = shadow.norm();
  if (share < kUpright) return kNothingHit;
  return CastInPlane(origin, shadow / share, max_m * share) / share;
}

double FlatScene::CastInPlane(const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction, double max_m) const {
  const double to_wall = walls_.Cast(origin_map, direction, max_m);
  double nearest = std::min(to_wall, max_m);
  const Pane* mirror = nullptr;  // The nearest pane that does not let the ray through, if it mirrors.
  bool seen = false;
  for (const Pane& pane : panes_) {
    const double range = CastAtSegment({pane.a_map, pane.b_map}, origin_map, direction);
    if (range >= nearest || range < kOffPaneM) continue;
    const double incidence = IncidenceOn(pane, direction);
    if (incidence > pane.seen_rad && incidence < kMirrorRad) continue;
    nearest = range;
    seen = incidence <= pane.seen_rad;
    mirror = seen ? nullptr : &pane;
  }
  if (seen) return nearest;
  if (mirror == nullptr) return to_wall;
  const Eigen::Vector2d along = (mirror->b_map - mirror->a_map).normalized();
  const Eigen::Vector2d mirrored = 2.0 * along.dot(direction) * along - direction;
  return nearest + walls_.Cast(origin_map + nearest * direction, mirrored, max_m - nearest);
}

double CastAtPost(const Post& post, const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction) {
  const Eigen::Vector2d origin = origin_map.head<2>(), shadow = direction.head<2>();
  const double share = direction.z() == 0.0 ? 1.0 : shadow.norm();
  double nearest = kNothingHit;
  if (share >= kUpright) {
    const double range = CastAtDisc(post.disc, origin, shadow / share) / share;
    const double height = origin_map.z() + (std::isinf(range) ? 0.0 : range * direction.z());
    if (height >= 0.0 && height <= post.height_m) nearest = range;
  }
  if (direction.z() < 0.0 && origin_map.z() > post.height_m) {
    const double range = (post.height_m - origin_map.z()) / direction.z();
    if ((origin + range * shadow - post.disc.center_map).norm() <= post.disc.radius_m)
      nearest = std::min(nearest, range);
  }
  return nearest;
}

double CastAtPosts(std::span<const Post> posts, const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction) {
  double nearest = kNothingHit;
  for (const Post& post : posts) nearest = std::min(nearest, CastAtPost(post, origin_map, direction));
  return nearest;
}

Surroundings SurroundingsOf(World world) {
  Surroundings surroundings;
  surroundings.name = std::move(world.name);
  surroundings.scene = std::make_shared<FlatScene>(RayCaster(std::move(world.segments)), std::move(world.panes));
  for (const Disc& disc : world.discs) surroundings.posts.push_back({disc});
  surroundings.walkers = std::move(world.walkers);
  surroundings.doors = std::move(world.doors);
  surroundings.routes = std::move(world.routes);
  return surroundings;
}

Surroundings SurroundingsOf(World3 world) {
  Surroundings surroundings;
  surroundings.name = std::move(world.name);
  surroundings.scene = std::make_shared<SolidScene>(std::move(world.rectangles));
  surroundings.routes = std::move(world.routes);
  return surroundings;
}

}  // namespace cairn::sim
