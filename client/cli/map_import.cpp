// `cairn map import`: a map of Nav2 as a site, in the file of a saved site.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/option_checks.h"
#include "common/map/map_tiles.h"
#include "common/service/names.h"
#include "server/store/site_file.h"
#include "server/store/site_from_map.h"
#include "server/store/sqlite_store.h"

namespace cairn::client {
namespace {

struct MapImportArguments {
  std::string map;
  std::string site;  // Empty: the name of the map's file.
  std::string output;
  double resolution_m = 0.05;
};

ExitCode ImportMap(Program& program, const MapImportArguments& arguments) {
  const std::string site =
      arguments.site.empty() ? std::filesystem::path(arguments.map).stem().string() : arguments.site;
  if (const auto valid = ValidateName("site", site); !valid) return program.Refuse(valid.error());
  const auto map = LoadMapYaml(arguments.map);
  if (!map) return program.Refuse(map.error());
  const auto cells = ResampleToTiles(*map, arguments.resolution_m);
  if (!cells) return program.Refuse({cells.error().code, arguments.map + ": " + cells.error().message});
  const auto store = server::OpenStore(std::string(server::kInMemory));
  if (!store) return program.Refuse(store.error());
  if (const auto added = server::AddSiteFromMap(**store, site, *cells, arguments.resolution_m); !added)
    return program.Refuse(added.error());
  if (const auto written = server::WriteSiteFile(**store, site, arguments.output); !written)
    return program.Refuse(written.error());
  return program.Print(fmt::format("{}: site {} of {} tiles with cells of {} m\n", arguments.output, site,
                                   cells->size(), arguments.resolution_m),
                       {{"file", arguments.output},
                        {"site", site},
                        {"tiles", cells->size()},
                        {"resolution_m", arguments.resolution_m},
                        {"resolution_of_map_m", map->resolution_m}});
}

}  // namespace

void AddMapImport(CLI::App& map, Program& program) {
  auto* command = map.add_subcommand("import", "Make a site of a map of Nav2: map.yaml and the image beside it");
  command->footer(
      "The file that is written is a saved site: a server loads it from saved/ in its state directory (`cairn site\n"
      "load`), and `cairn site import` adds it to the state of a stopped server. Robots that open a session there\n"
      "are localised in it with `cairn robot localise`.\n\n"
      "EXAMPLE\n  cairn map import hall.yaml -o /var/lib/cairn/saved/hall.site && cairn site load hall");
  auto arguments = std::make_shared<MapImportArguments>();
  command->add_option("map", arguments->map, "The map.yaml file")->required()->type_name("FILE");
  command->add_option("--site", arguments->site, "The site's name [that of the file]");
  command->add_option("-o,--output", arguments->output, "The file of a saved site to write")
      ->required()
      ->type_name("FILE");
  command->add_option("--resolution", arguments->resolution_m, "slam.grid.resolution_m of the server (m)")
      ->check(InRange(0.001, 10.0))
      ->capture_default_str();
  program.OnChosen(*command, arguments, ImportMap);
}

}  // namespace cairn::client
