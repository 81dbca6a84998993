#include "client/sim/shipped_worlds.h"

#include <filesystem>
#include <string_view>
#include <utility>

#include "client/sim/world3_file.h"
#include "client/sim/world_file.h"

namespace cairn::sim {
namespace {

constexpr std::pair<std::string_view, std::string_view> kWorlds[] = {
#include "client/sim/shipped_worlds.inc"
};

constexpr std::pair<std::string_view, std::string_view> kWorlds3[] = {
#include "client/sim/shipped_worlds3.inc"
};

bool IsSpatial(const std::string& name_or_path) {
  for (const auto& world : kWorlds3)
    if (world.first == name_or_path) return true;
  const std::string extension = std::filesystem::path(name_or_path).extension().string();
  return extension == ".yaml" || extension == ".yml";
}

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

std::vector<std::string> ShippedWorld3Names() {
  std::vector<std::string> names;
  for (const auto& world : kWorlds3) names.emplace_back(world.first);
  return names;
}

Result<World3> OpenWorld3(const std::string& name_or_path) {
  std::string known;
  for (const auto& [name, text] : kWorlds3) {
    if (name == name_or_path) return ParseWorld3(std::string(text), std::string(name) + ".yaml");
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  if (!std::filesystem::exists(name_or_path)) {
    return Fail(StatusCode::kNotFound, "world '" + name_or_path + "' is neither a file nor one of: " + known);
  }
  return ReadWorld3File(name_or_path);
}

Result<Surroundings> OpenSurroundings(const std::string& name_or_path) {
  if (IsSpatial(name_or_path))
    return OpenWorld3(name_or_path).map([](World3&& w) { return SurroundingsOf(std::move(w)); });
  return OpenWorld(name_or_path).map([](World&& w) { return SurroundingsOf(std::move(w)); });
}

}  // namespace cairn::sim
