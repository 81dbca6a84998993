// The place in which a fleet drives, flat or in space: obstacles that stand still, people who walk, and routes. A
// value: copies share what is immutable.
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
  std::vector<Walker> walkers;  // People, all of the height kWalkerHeight_m.
  std::vector<Route> routes;
};
inline constexpr double kWalkerHeight_m = 1.75;

[[nodiscard]] Surroundings SurroundingsOf(World world);
[[nodiscard]] Surroundings SurroundingsOf(World3 world);

}  // namespace cairn::sim
