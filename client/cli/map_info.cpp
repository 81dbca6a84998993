#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

ExitCode ShowMapInfo(Program& program, const std::string& site) {
  Request request;
  request.kind = RequestKind::kMapInfo;
  request.site = site;
  const auto reply = program.Ask(request);
  if (!reply) return program.Refuse(reply.error());
  std::string text = reply->maps.empty() ? "no map yet\n" : "";
  nlohmann::json maps = nlohmann::json::array();
  for (const MapInfo& map : reply->maps) {
    text += FormatMap(map);
    maps.push_back(ToJson(map));
  }
  return program.Print(text, {{"maps", maps}});
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
  command->callback([&program, site] { program.action = [&program, site] { return ShowMapInfo(program, *site); }; });
}

}  // namespace cairn::client
