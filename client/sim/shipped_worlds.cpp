#include "client/sim/shipped_worlds.h"

#include <filesystem>
#include <string_view>
#include <utility>

#include "client/sim/world_file.h"
#include "common/file/atomic_file.h"

namespace cairn::sim {
namespace {

constexpr std::pair<std::string_view, std::string_view> kWorlds[] = {
#include "client/sim/shipped_worlds.inc"
};

template <typename AnyWorld>
Result<AnyWorld> Open(const std::string& name_or_path,
                      Result<AnyWorld> (*parse)(const std::string&, const std::string&)) {
  std::string known;
  for (const auto& [name, text] : kWorlds) {
    if (name == name_or_path) return parse(std::string(text), std::string(name) + ".yaml");
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  if (!std::filesystem::exists(name_or_path)) {
    return Fail(StatusCode::kNotFound, "world '" + name_or_path + "' is neither a file nor one of: " + known);
  }
  const auto bytes = ReadWholeFile(name_or_path, kMaxWorldBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  auto world = parse({bytes->begin(), bytes->end()}, name_or_path);
  if (world && world->name.empty()) world->name = std::filesystem::path(name_or_path).stem().string();
  return world;
}

}  // namespace

std::vector<std::string> ShippedWorldNames() {
  std::vector<std::string> names;
  for (const auto& world : kWorlds) names.emplace_back(world.first);
  return names;
}

Result<World> OpenWorld(const std::string& name_or_path) {
  return Open<World>(name_or_path, &ParseWorld);
}

Result<World3> OpenWorld3(const std::string& name_or_path) {
  return Open<World3>(name_or_path, &ParseWorld3);
}

Result<Surroundings> OpenSurroundings(const std::string& name_or_path) {
  return Open<Surroundings>(name_or_path, &ParseSurroundings);
}

}  // namespace cairn::sim
