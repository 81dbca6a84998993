#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

ExitCode ShowMapInfo(Program& program, const std::string& site) {
  const auto maps = program.Ask([&](QueryClient& server) -> Result<std::vector<MapInfo>> {
    if (site.empty()) return server.Maps();
    return server.Map(site).map([](MapInfo&& map) { return std::vector<MapInfo>{std::move(map)}; });
  });
  if (!maps) return program.Refuse(maps.error());
  std::string text = maps->empty() ? "no map yet\n" : "";
  for (const MapInfo& map : *maps) text += FormatMap(map);
  return program.Print(text, {{"maps", *maps}});
}

}  // namespace

void AddMap(CLI::App& app, Program& program) {
  auto* map = app.add_subcommand("map", "A site's map: what it is, export, versions, pictures");
  map->require_subcommand(1);
  AddMapInfo(*map, program);
  AddMapExport(*map, program);
  AddMapEnable(*map, program);
  AddMapDraw(*map, program);
}

void AddMapInfo(CLI::App& map, Program& program) {
  auto* command = map.add_subcommand("info", "Bounds, versions and sizes of all maps, or of one");
  auto site = std::make_shared<std::string>();
  command->add_option("--site", *site, "Only this site");
  program.OnChosen(*command, site, ShowMapInfo);
}

}  // namespace cairn::client
