#include "client/sim/furniture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "client/sim/random.h"
#include "common/geometry/angle.h"

namespace cairn::sim {
namespace {

constexpr double kLeastRadiusM = 0.2, kMostRadiusM = 0.45;
constexpr double kFromRouteM = 0.7;  // At least, from the side of a piece to any route.
constexpr double kFarthestM = 3.5;   // From the route, at most.
constexpr double kFromOthersM = 0.3;
constexpr double kFromWallsM = 0.15;
constexpr double kLaserHeightM = 0.3;
constexpr int kTriesPerPiece = 200;
constexpr int kDirections = 24;  // In which a piece must not touch a wall.

double Between(double low, double high, Random& random) {
  return low + (high - low) * Uniform(random);
}

double DistanceToSegment(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double length2 = along.squaredNorm();
  const double at = length2 > 0.0 ? std::clamp((p - a).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (p - a - at * along).norm();
}

double DistanceToRoute(const Eigen::Vector2d& p, const Route& route) {
  double nearest = std::numeric_limits<double>::infinity();
  const auto& points = route.waypoints_map;
  for (std::size_t i = 0; i < points.size(); ++i)
    nearest = std::min(nearest, DistanceToSegment(p, points[i], points[(i + 1) % points.size()]));
  return nearest;
}

class Placing {
 public:
  explicit Placing(const Surroundings& place) : place_(place), all_(place.posts) {}

  std::optional<Post> Try(Random& random) {
    const auto& routes = place_.routes;
    const auto& route = routes[std::min(
        routes.size() - 1, static_cast<std::size_t>(Uniform(random) * static_cast<double>(routes.size())))];
    const PathPlace on_route =
        PlaceOnPath(route.waypoints_map, Between(0.0, ClosedLength(route.waypoints_map), random));
    const double side = Uniform(random) < 0.5 ? 0.5 : -0.5;
    const double bearing = on_route.heading_rad + side * kPi;
    const double radius = Between(kLeastRadiusM, kMostRadiusM, random);
    const double away = Between(kFromRouteM + radius, kFarthestM, random);
    const Eigen::Vector2d towards(std::cos(bearing), std::sin(bearing));
    const Post post{{on_route.p_map + away * towards, radius}};
    if (!Fits(post) || Cast(on_route.p_map, towards, away + radius) < away + radius) return std::nullopt;
    all_.push_back(post);
    return post;
  }

 private:
  [[nodiscard]] double Cast(const Eigen::Vector2d& from, const Eigen::Vector2d& towards, double max_m) const {
    return place_.scene->Cast({from.x(), from.y(), kLaserHeightM}, {towards.x(), towards.y(), 0.0}, max_m);
  }
  [[nodiscard]] bool Fits(const Post& post) const {
    const Eigen::Vector2d& centre = post.disc.center_map;
    const double radius = post.disc.radius_m;
    for (const Route& route : place_.routes)
      if (DistanceToRoute(centre, route) < radius + kFromRouteM) return false;
    for (const Post& other : all_) {
      const double apart = (other.disc.center_map - centre).norm() - other.disc.radius_m - radius;
      if (apart < kFromOthersM) return false;
    }
    for (int i = 0; i < kDirections; ++i) {
      const double direction = 2.0 * kPi * i / kDirections;
      const double free_m = radius + kFromWallsM;
      if (Cast(centre, {std::cos(direction), std::sin(direction)}, free_m) < free_m) return false;
    }
    return true;
  }

  const Surroundings& place_;
  std::vector<Post> all_;
};

}  // namespace

Result<void> Validate(const FurnitureOptions& options) {
  if (options.pieces >= 0 && options.pieces <= 1000) return {};
  return Fail(StatusCode::kInvalidArgument, "furniture: there may be 0..1000 pieces");
}

std::vector<Post> FurnitureIn(const Surroundings& place, const FurnitureOptions& options) {
  Random random(options.seed);
  Placing placing(place);
  std::vector<Post> furniture;
  const auto wanted = static_cast<std::size_t>(options.pieces);
  for (int tries = 0; furniture.size() < wanted && tries < kTriesPerPiece * options.pieces; ++tries)
    if (const auto post = placing.Try(random)) furniture.push_back(*post);
  return furniture;
}

}  // namespace cairn::sim
