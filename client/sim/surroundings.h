// What a fleet drives in, flat or in space: what stands still, who walks, and where the routes lead. A value: copies
// share what is immutable.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/sim/scene.h"
#include "client/sim/world.h"
#include "client/sim/world3.h"
#include "common/status.h"

namespace cairn::sim {

struct Surroundings {
  std::string name;
  std::shared_ptr<const Scene> scene;
  std::vector<Post> posts;      // Round things that stand still.
  std::vector<Walker> walkers;  // People, of kWalkerHeight_m.
  std::vector<Route> routes;
};
inline constexpr double kWalkerHeight_m = 1.75;

[[nodiscard]] Surroundings SurroundingsOf(World world);
[[nodiscard]] Surroundings SurroundingsOf(World3 world);

}  // namespace cairn::sim
