#include <fmt/format.h>

#include "client/cli/commands.h"

namespace cairn::client {
namespace {

struct ExportArguments {
  std::string site;
  std::string file;
  std::string image = "png";
  std::string mode = "trinary";
};

ExitCode ExportMap(Program& program, const ExportArguments& arguments) {
  const auto map = program.Ask([&](QueryClient& server) { return server.MapImage(arguments.site); });
  if (!map) return program.Refuse(map.error());
  MapSaveOptions options;
  options.mode = arguments.mode == "raw"     ? MapImageMode::kRaw
                 : arguments.mode == "scale" ? MapImageMode::kScale
                                             : MapImageMode::kTrinary;
  if (const auto saved = SaveMapYaml(*map, arguments.file, "." + arguments.image, options); !saved) {
    return program.Refuse(saved.error());
  }
  return program.Print(
      fmt::format("{}: {} x {} cells of {} m\n", arguments.file, map->width, map->height, map->resolution_m),
      {{"file", arguments.file}, {"width", map->width}, {"height", map->height}, {"resolution_m", map->resolution_m}});
}

}  // namespace

void AddMapExport(CLI::App& map, Program& program) {
  auto* command = map.add_subcommand("export", "Write the map for Nav2 and others: map.yaml and an image beside it");
  command->footer(
      "EXAMPLES\n  cairn map export --site hall -o hall.yaml\n  cairn map export --site hall -o hall.yaml --image pgm");
  auto arguments = std::make_shared<ExportArguments>();
  command->add_option("--site", arguments->site, "The site's name")->required();
  command->add_option("-o,--output", arguments->file, "The yaml file to write")->required()->type_name("FILE");
  command->add_option("--image", arguments->image, "Format of the image")
      ->check(CLI::IsMember({"png", "pgm"}))
      ->capture_default_str();
  command->add_option("--mode", arguments->mode, "Meaning of the image's values, as map_server has them")
      ->check(CLI::IsMember({"trinary", "scale", "raw"}))
      ->capture_default_str();
  program.OnChosen(*command, arguments, ExportMap);
}

}  // namespace cairn::client
