#include <fmt/format.h>

#include <filesystem>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/quantity_text.h"
#include "common/file/atomic_file.h"

namespace cairn::client {
namespace {

struct TilesArguments {
  TileQuery query;
  std::string directory;
};

Result<void> SaveTile(const Tile& tile, const std::filesystem::path& directory) {
  const char* extension = tile.encoding == TileEncoding::kPng ? "png" : "raw";
  const auto name = fmt::format("L{}_{}_{}.{}", tile.key.level, tile.key.x, tile.key.y, extension);
  return WriteFileAtomically(directory / name, {reinterpret_cast<const char*>(tile.bytes.data()), tile.bytes.size()});
}

ExitCode ShowTiles(Program& program, const TilesArguments& arguments) {
  const auto answer = program.Ask([&](QueryClient& server) { return server.Tiles(arguments.query); });
  if (!answer) return program.Refuse(answer.error());
  if (!arguments.directory.empty()) {
    std::error_code error;
    std::filesystem::create_directories(arguments.directory, error);
    if (error) return program.Refuse({StatusCode::kUnavailable, arguments.directory + ": " + error.message()});
    for (const Tile& tile : answer->tiles) {
      if (const auto saved = SaveTile(tile, arguments.directory); !saved) return program.Refuse(saved.error());
    }
  }
  std::size_t bytes = 0;
  std::string text;
  for (const Tile& tile : answer->tiles) {
    bytes += tile.bytes.size();
    text += fmt::format("level {}  x {:4d}  y {:4d}  version {:8d}  {:6d} bytes\n", tile.key.level, tile.key.x,
                        tile.key.y, tile.version, tile.bytes.size());
  }
  text += fmt::format("{} tiles, {} bytes, generation {}, epoch {}, version {}\n", answer->tiles.size(), bytes,
                      answer->generation, answer->epoch, answer->version);
  return program.Print(text, {{"tiles", answer->tiles},
                              {"bytes", bytes},
                              {"generation", answer->generation},
                              {"map_epoch", answer->epoch},
                              {"map_version", answer->version}});
}

}  // namespace

void AddTiles(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("tiles", "Tiles of a site's map, by area, level and age");
  command->footer(
      "A tile has 128 x 128 cells; level 0 is the finest, each further level halves the resolution.\n"
      "With --since-version only the tiles that changed after that version are listed. If the map is no longer in the\n"
      "epoch given by --since-epoch, or the server was started since (--since-generation), all tiles are listed.\n"
      "EXAMPLES\n  cairn tiles --site hall --level 2\n  cairn tiles --site hall --area -5,-5,20,10 -o tiles/\n"
      "  cairn tiles --site hall --since-generation 1700000000000 --since-epoch 1 --since-version 420");
  auto arguments = std::make_shared<TilesArguments>();
  TileQuery& query = arguments->query;
  command->add_option("--site", query.site, "The site's name")->required();
  command->add_option("--level", query.level, "Level of the pyramid")->check(CLI::Range(0, kPyramidLevels - 1));
  command->add_flag("--disagreement", query.disagreement, "Tiles of where robots differ, instead of the map's");
  AddParsed(*command, "--area", query.area, ParseArea, "Only tiles that touch this area", "XMIN,YMIN,XMAX,YMAX");
  auto* version = command->add_option("--since-version", query.since_version, "Only tiles changed after this version");
  command->add_option("--since-epoch", query.since_epoch, "The epoch that version belongs to")->needs(version);
  command->add_option("--since-generation", query.since_generation, "The server's generation that both belong to")
      ->needs(version);
  command->add_option("-o,--output", arguments->directory, "Directory to save the tiles into (L<level>_<x>_<y>.png)")
      ->type_name("DIR");
  program.OnChosen(*command, arguments, ShowTiles);
}

}  // namespace cairn::client
