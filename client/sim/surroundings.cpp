#include "client/sim/surroundings.h"

#include <utility>

namespace cairn::sim {
namespace {

// A flat scene together with the walls it looks at.
class OwningFlatScene : public Scene {
 public:
  explicit OwningFlatScene(std::vector<Segment> segments) : walls_(std::move(segments)), scene_(walls_) {}
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction,
                            double max_m) const override {
    return scene_.Cast(origin_map, direction, max_m);
  }

 private:
  RayCaster walls_;
  FlatScene scene_;
};

}  // namespace

Surroundings SurroundingsOf(World world) {
  Surroundings surroundings;
  surroundings.name = std::move(world.name);
  surroundings.scene = std::make_shared<OwningFlatScene>(std::move(world.segments));
  for (const Disc& disc : world.discs) surroundings.posts.push_back({disc});
  surroundings.walkers = std::move(world.walkers);
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
