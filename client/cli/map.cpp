#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/cli/commands.h"
#include "client/cli/frame_option.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "common/map/building_frame.h"

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

struct ExportArguments {
  std::string site;
  std::string file;
  std::string image = "png";
  std::string mode = "trinary";
  std::string keep_out;  // The yaml file of the mask; empty: none.
  std::string frame = "map";
};

namespace fs = std::filesystem;

// The mask of Nav2's keepout filter: occupied where robots must not drive, free elsewhere, and as large as the map.
OccupancyImage KeepOutMask(OccupancyImage map, const std::vector<MapEdit>& edits) {
  std::ranges::fill(map.cells, std::uint8_t{0});
  const auto column = static_cast<int>(std::lround(map.T_map_origin.x / map.resolution_m));
  const auto row = static_cast<int>(std::lround(map.T_map_origin.y / map.resolution_m));
  for (const MapEdit& edit : edits) {
    if (edit.kind != MapEditKind::kKeepOut) continue;
    for (const CellRun& run : CellsOf(edit, map.resolution_m)) {
      const int y = run.y - row;
      if (y < 0 || y >= map.height) continue;
      for (int x = std::max(0, run.x_first - column); x <= std::min(map.width - 1, run.x_last - column); ++x)
        map.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(x)] =
            100;
    }
  }
  return map;
}

ExitCode ExportMap(Program& program, const ExportArguments& arguments) {
  // Both would have the same image.
  if (fs::path(arguments.keep_out).replace_extension() == fs::path(arguments.file).replace_extension())
    return program.Refuse({StatusCode::kInvalidArgument, "--keep-out must have another name than the map"});
  const auto map = program.Ask([&](QueryClient& server) { return server.MapImage(arguments.site); });
  if (!map) return program.Refuse(map.error());
  const auto T_map_frame = FrameOf(program, arguments.frame, arguments.site);
  if (!T_map_frame) return program.Refuse(T_map_frame.error());
  MapSaveOptions options;
  options.mode = arguments.mode == "raw"     ? MapImageMode::kRaw
                 : arguments.mode == "scale" ? MapImageMode::kScale
                                             : MapImageMode::kTrinary;
  if (const auto saved = SaveMapYaml(InFrame(*map, *T_map_frame), arguments.file, "." + arguments.image, options);
      !saved) {
    return program.Refuse(saved.error());
  }
  if (!arguments.keep_out.empty()) {
    const auto edits = program.Ask([&](QueryClient& server) { return server.MapEdits(arguments.site); });
    if (!edits) return program.Refuse(edits.error());
    const auto saved = SaveMapYaml(InFrame(KeepOutMask(*map, *edits), *T_map_frame), arguments.keep_out,
                                   "." + arguments.image, options);
    if (!saved) return program.Refuse(saved.error());
  }
  const auto with_image = [&](const std::string& file) {
    return file + " and " + fs::path(file).replace_extension(arguments.image).string();
  };
  std::string text = fmt::format("{}: {} x {} cells of {} m\n", with_image(arguments.file), map->width, map->height,
                                 map->resolution_m);
  if (!arguments.keep_out.empty()) text += with_image(arguments.keep_out) + ": the areas where robots must not drive\n";
  return program.Print(text, {{"file", arguments.file},
                              {"width", map->width},
                              {"height", map->height},
                              {"resolution_m", map->resolution_m},
                              {"frame", arguments.frame},
                              {"keep_out", arguments.keep_out}});
}

struct EnableArguments {
  std::string site;
  std::uint32_t version = 0;  // 0: the version before the enabled one.
};

ExitCode Enable(Program& program, const EnableArguments& arguments) {
  const auto map = program.Ask([&](QueryClient& server) {
    return arguments.version == 0 ? server.RollBackMap(arguments.site)
                                  : server.EnableMap(arguments.site, arguments.version);
  });
  if (!map) return program.Refuse(map.error());
  return program.Print(FormatMap(*map), *map);
}

void AddMapInfo(CLI::App& map, Program& program) {
  auto* command = map.add_subcommand("info", "Bounds, versions and sizes of all maps, or of one");
  auto site = std::make_shared<std::string>();
  command->add_option("--site", *site, "Only this site");
  program.OnChosen(*command, site, ShowMapInfo);
}

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
  command
      ->add_option(
          "--keep-out", arguments->keep_out,
          "Also write the areas where robots must not drive, as the mask of Nav2's keepout filter: this yaml file "
          "and an image beside it. The mask is as large as the map: what lies beyond is not in it")
      ->type_name("FILE");
  AddFrame(*command, arguments->frame);
  program.OnChosen(*command, arguments, ExportMap);
}

void AddMapEnable(CLI::App& map, Program& program) {
  auto arguments = std::make_shared<EnableArguments>();
  auto* enable = map.add_subcommand("enable", "Switch the site to one of its map versions (see `cairn map info`)");
  enable->add_option("--site", arguments->site, "The site's name")->required();
  enable->add_option("--version", arguments->version, "The version to enable")->required()->check(InRange(1, 4e9));
  program.OnChosen(*enable, arguments, Enable);
  auto* rollback = map.add_subcommand("rollback", "Switch the site to the map version before the enabled one");
  rollback->add_option("--site", arguments->site, "The site's name")->required();
  program.OnChosen(*rollback, arguments, Enable);
}

}  // namespace

void AddMap(CLI::App& app, Program& program) {
  auto* map = app.add_subcommand("map", "A site's map: what it is, export, import, versions, pictures, edits");
  map->require_subcommand(1);
  AddMapInfo(*map, program);
  AddMapExport(*map, program);
  AddMapImport(*map, program);
  AddMapEnable(*map, program);
  AddMapDraw(*map, program);
  AddMapAnimate(*map, program);
  AddMapEdit(*map, program);
}

}  // namespace cairn::client
