// What a laser's rays can hit in a world: what stands still (a scene), and what moves (posts). A scene is flat, with
// walls of any height and no floor, or made of rectangles in space. Frame: `map`, metres, z up. Immutable, thread-safe.
#pragma once

#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/sim/rectangle_tree.h"
#include "client/sim/world.h"
#include "client/sim/world3.h"
#include "common/status.h"

namespace cairn::sim {

class Scene {
 public:
  virtual ~Scene() = default;
  // Distance along the ray (`direction` of length 1) to what stands still, within `max_m`; else kNothingHit.
  [[nodiscard]] virtual double Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction,
                                    double max_m) const = 0;
};

// The segments of a flat world as walls without an upper end: a ray that rises or falls meets a wall where its
// projection onto the floor does. Panes of glass likewise; what a pane mirrors is a wall, never a post, and is mirrored
// once. Panes are tried one by one, so there should be few.
class FlatScene : public Scene {
 public:
  explicit FlatScene(RayCaster walls, std::vector<Pane> panes = {})
      : walls_(std::move(walls)), panes_(std::move(panes)) {}
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction,
                            double max_m) const override;

 private:
  [[nodiscard]] double CastInPlane(const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction,
                                   double max_m) const;

  RayCaster walls_;
  std::vector<Pane> panes_;
};

class SolidScene : public Scene {
 public:
  explicit SolidScene(std::vector<Rectangle> rectangles) : tree_(std::move(rectangles)) {}
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction,
                            double max_m) const override {
    return tree_.Cast(origin_map, direction, max_m);
  }

 private:
  RectangleTree tree_;
};

// An upright cylinder that stands on the floor: a person, a robot, a pillar of a flat world.
struct Post {
  Disc disc;
  double height_m = std::numeric_limits<double>::infinity();
};

// Distance along the ray to the post's side or top; kNothingHit if it misses or starts inside.
[[nodiscard]] double CastAtPost(const Post& post, const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction);
[[nodiscard]] double CastAtPosts(std::span<const Post> posts, const Eigen::Vector3d& origin_map,
                                 const Eigen::Vector3d& direction);

// The place in which a fleet drives, flat or in space: obstacles that stand still, people who walk, doors, and routes.
// A value: copies share what is immutable.
struct Surroundings {
  std::string name;
  std::shared_ptr<const Scene> scene;
  std::vector<Post> posts;      // Round things that stand still.
  std::vector<Walker> walkers;  // People, all of the height kWalkerHeight_m.
  std::vector<Door> doors;      // As high as anything. One that a robot is about to touch opens.
  std::vector<Route> routes;
};
inline constexpr double kWalkerHeight_m = 1.75;

[[nodiscard]] Surroundings SurroundingsOf(World world);
[[nodiscard]] Surroundings SurroundingsOf(World3 world);

}  // namespace cairn::sim
