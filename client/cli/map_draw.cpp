#include <fmt/format.h>

#include "client/cli/commands.h"
#include "client/cli/frame_option.h"
#include "client/cli/map_picture.h"
#include "client/cli/quantity_text.h"
#include "common/map/building_frame.h"

namespace cairn::client {
namespace {

struct DrawArguments {
  std::string site;
  std::string map_file;
  std::string layer = "map";
  std::vector<std::string> robots;
  std::vector<std::string> paths;
  std::vector<std::string> truths;
  std::string output;
  std::string frame = "map";
  PictureOptions picture;
};

Result<std::vector<PicturePath>> CollectPaths(Program& program, const DrawArguments& arguments) {
  std::vector<PicturePath> paths;
  for (const std::string& robot : arguments.robots) {
    auto path = program.Ask([&](QueryClient& server) { return server.Path(robot); });
    if (!path) return tl::unexpected(path.error());
    paths.push_back({robot, std::move(path->poses), false});
  }
  for (const bool reference : {false, true}) {
    for (const std::string& text : reference ? arguments.truths : arguments.paths) {
      const LabelledFile file = ParseLabelledFile(text);
      auto trajectory = ReadTum(file.path);
      if (!trajectory) return tl::unexpected(trajectory.error());
      paths.push_back({file.label, std::move(*trajectory), reference});
    }
  }
  return paths;
}

ExitCode DrawMap(Program& program, const DrawArguments& arguments) {
  if (const auto allowed = CheckPictureFile(arguments.output); !allowed) return program.Refuse(allowed.error());
  const auto ask = [&](QueryClient& server) {
    return arguments.layer == "disagreement" ? server.DisagreementImage(arguments.site)
                                             : server.MapImage(arguments.site);
  };
  const auto map = arguments.map_file.empty() ? program.Ask(ask) : LoadMapYaml(arguments.map_file);
  if (!map) return program.Refuse(map.error());
  auto paths = CollectPaths(program, arguments);
  if (!paths) return program.Refuse(paths.error());
  const auto T_map_frame = FrameOf(program, arguments.frame, arguments.site);
  if (!T_map_frame) return program.Refuse(T_map_frame.error());
  for (PicturePath& path : *paths) MoveInto(path.trajectory, *T_map_frame);
  const auto png =
      DrawMapPicture(arguments.frame == "map" ? *map : InFrame(*map, *T_map_frame), *paths, arguments.picture);
  if (!png) return program.Refuse(png.error());
  if (const auto written = WritePictureFile(arguments.output, *png); !written) return program.Refuse(written.error());
  return program.Print(fmt::format("{}: {} path{}, {} KiB\n", arguments.output, paths->size(),
                                   paths->size() == 1 ? "" : "s", png->size() / 1024),
                       {{"file", arguments.output}, {"paths", paths->size()}, {"bytes", png->size()}});
}

}  // namespace

void AddMapDraw(CLI::App& map, Program& program) {
  auto* command = map.add_subcommand("draw", "Draw the map and trajectories over it as a picture for people");
  command->footer(
      "The map comes from the server (--site) or a file (--map); paths from the server (--robots) or TUM files.\n"
      "With --layer disagreement, dark cells are those that one robot has seen occupied and another one free, or that\n"
      "have changed since an earlier run; white ones are agreed on, grey ones seen by one only.\n"
      "EXAMPLES\n  cairn map draw --site hall --robots robot1 robot2 -o hall-picture.png\n"
      "  cairn map draw --site hall --layer disagreement -o hall-differs.png\n"
      "  cairn map draw --map hall.yaml --paths \"robot 1=r1.tum\" --truth truth=t1.tum -o hall-picture.png");
  auto arguments = std::make_shared<DrawArguments>();
  auto* source = command->add_option_group("map's source");
  source->add_option("--site", arguments->site, "The site's name: the map the server has now");
  auto* file = source->add_option("--map", arguments->map_file, "A map.yaml file")->type_name("FILE");
  source->require_option(1);
  command->add_option("--layer", arguments->layer, "What of the site: its map, or where robots differ")
      ->check(CLI::IsMember({"map", "disagreement"}))
      ->excludes(file)
      ->capture_default_str();
  command->add_option("--robots", arguments->robots, "Robots whose paths are asked from the server");
  command->add_option("--paths", arguments->paths, "TUM files, each with a label where wanted")
      ->type_name("[LABEL=]FILE");
  command->add_option("--truth", arguments->truths, "TUM files of true paths, drawn thin below the others")
      ->type_name("[LABEL=]FILE");
  command->add_option("-o,--output", arguments->output, "The PNG file to write")->required()->type_name("FILE");
  command->add_option("--width", arguments->picture.width_px, "Pixels across")
      ->check(CLI::Range(200, 8000))
      ->capture_default_str();
  AddFrame(*command, arguments->frame)->excludes(file);
  command->add_option("--title", arguments->picture.title, "Title above the map");
  program.OnChosen(*command, arguments, DrawMap);
}

}  // namespace cairn::client
