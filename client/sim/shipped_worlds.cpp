#include "client/sim/shipped_worlds.h"

#include <string_view>
#include <utility>

#include "client/sim/world_file.h"

namespace cairn::sim {
namespace {

constexpr std::pair<std::string_view, std::string_view> kWorlds[] = {
#include "client/sim/shipped_worlds.inc"
};

}  // namespace

std::vector<std::string> ShippedWorldNames() {
  std::vector<std::string> names;
  for (const auto& world : kWorlds) names.emplace_back(world.first);
  return names;
}

Result<World> OpenWorld(const std::string& name_or_path) {
  std::string known;
  for (const auto& [name, text] : kWorlds) {
    if (name == name_or_path) return ParseWorld(text, std::string(name) + ".world");
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  if (!std::filesystem::exists(name_or_path)) {
    return Fail(StatusCode::kNotFound, "world '" + name_or_path + "' is neither a file nor one of: " + known);
  }
  return ReadWorldFile(name_or_path);
}

}  // namespace cairn::sim
