// `cairn map edit`: what people say about a map (common/map/map_edit.h).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/cli/commands.h"
#include "client/cli/edit_warning.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "common/map/building_frame.h"

namespace cairn::client {
namespace {

struct DrawnEditArguments {
  std::string site;
  MapEdit edit;
  std::vector<Eigen::Vector2d> area, line, box;  // One of them.
  double width_m = 0.1;                          // Of a line.
};
struct OriginArguments {
  std::string site;
  std::string note;
  std::vector<Eigen::Vector2d> at = {Eigen::Vector2d::Zero()};
  std::vector<Eigen::Vector2d> axis;  // A point on the x axis; empty: see below.
  bool along_walls = false;
  double turned_deg = 0.0;
};
struct KnownEditArguments {
  std::string site;
  std::uint64_t id = 0;
};

Result<Eigen::Vector2d> PointFrom(const std::string& text) {
  Eigen::Vector2d point;
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos || !ParseNumber(text.substr(0, comma), point.x()) ||
      !ParseNumber(text.substr(comma + 1), point.y()))
    return Fail(StatusCode::kInvalidArgument, "'" + text + "' is not a point X,Y in metres");
  return point;
}

CLI::Option* AddPoints(CLI::App& app, const std::string& name, std::vector<Eigen::Vector2d>& points, int fewest,
                       int most, const std::string& help) {
  return app
      .add_option_function<std::vector<std::string>>(
          name,
          [&points, name](const std::vector<std::string>& texts) {
            points.clear();
            for (const std::string& text : texts) {
              const auto point = PointFrom(text);
              if (!point) throw CLI::ValidationError(name, point.error().message);
              points.push_back(*point);
            }
          },
          help)
      ->expected(fewest, most)
      ->type_name("X,Y ...");
}

ExitCode AddEdit(Program& program, const DrawnEditArguments& arguments) {
  MapEdit edit = arguments.edit;
  edit.points_map = arguments.area;
  if (!arguments.line.empty()) {
    edit.points_map = arguments.line;
    edit.width_m = arguments.width_m;
  }
  if (!arguments.box.empty()) {
    const Eigen::Vector2d &a = arguments.box[0], &b = arguments.box[1];
    edit.points_map = {a, {b.x(), a.y()}, b, {a.x(), b.y()}};
  }
  // Before the edit, because a wall outside makes the map larger.
  const auto map = program.Ask([&](QueryClient& server) { return server.Map(arguments.site); });
  const auto added = program.Ask([&](QueryClient& server) { return server.AddMapEdit(arguments.site, edit); });
  if (!added) return program.Refuse(added.error());
  const std::string warning = map ? EditWarning(*added, *map) : "";
  if (!warning.empty()) program.err() << "cairn: warning: edit " << added->id << ": " << warning << "\n";
  return program.Print(FormatEdit(*added), *added);
}

ExitCode SetOrigin(Program& program, const OriginArguments& arguments) {
  double turned_rad = arguments.turned_deg * std::numbers::pi / 180.0;
  if (arguments.along_walls) {
    const auto direction = program.Ask([&](QueryClient& server) { return server.MapImage(arguments.site); })
                               .and_then([](const OccupancyImage& map) { return WallDirection(map); });
    if (!direction) return program.Refuse(direction.error());
    turned_rad = *direction;
  }
  const Eigen::Vector2d& origin = arguments.at.front();
  const Eigen::Vector2d ahead = origin + Eigen::Vector2d(std::cos(turned_rad), std::sin(turned_rad));
  const MapEdit edit{.kind = MapEditKind::kOrigin,
                     .points_map = {origin, arguments.axis.empty() ? ahead : arguments.axis.front()},
                     .note = arguments.note};
  const auto added = program.Ask([&](QueryClient& server) { return server.AddMapEdit(arguments.site, edit); });
  if (!added) return program.Refuse(added.error());
  const Pose2 T_map_building = BuildingFrameOf({*added}).value_or(Pose2{});
  nlohmann::json json = *added;
  json["T_map_building"] = T_map_building;
  return program.Print(
      fmt::format("{}: the building's origin is at {:.3f},{:.3f} of the map, turned by {:.3f} deg\n", added->id,
                  T_map_building.x, T_map_building.y, T_map_building.theta * 180.0 / std::numbers::pi),
      json);
}

ExitCode ListEdits(Program& program, const KnownEditArguments& arguments) {
  const auto edits = program.Ask([&](QueryClient& server) { return server.MapEdits(arguments.site); });
  if (!edits) return program.Refuse(edits.error());
  std::string text = edits->empty() ? "no edits\n" : "";
  for (const MapEdit& edit : *edits) text += FormatEdit(edit);
  return program.Print(text, {{"edits", *edits}});
}

ExitCode RemoveEdit(Program& program, const KnownEditArguments& arguments) {
  const auto removed =
      program.Ask([&](QueryClient& server) { return server.RemoveMapEdit(arguments.site, arguments.id); });
  if (!removed) return program.Refuse(removed.error());
  return program.Print(fmt::format("edit {} is removed\n", arguments.id), {{"removed", arguments.id}});
}

void AddKind(CLI::App& edit, Program& program, MapEditKind kind, const std::string& name, const std::string& help) {
  auto* command = edit.add_subcommand(name, help);
  auto arguments = std::make_shared<DrawnEditArguments>();
  arguments->edit.kind = kind;
  command->add_option("--site", arguments->site, "The site's name")->required();
  const int most = static_cast<int>(kMostEditPoints);
  auto* shape = command->add_option_group("shape", "Where, in metres of the map's frame");
  AddPoints(*shape, "--box", arguments->box, 2, 2, "Two opposite corners of a box, such as 8,0 10,3");
  AddPoints(*shape, "--area", arguments->area, 3, most, "The corners of an area, in order");
  auto* line = AddPoints(*shape, "--line", arguments->line, 2, most, "The points of a line");
  shape->require_option(1);
  AddNumber(*command, "--width", arguments->width_m, 0.01, 10.0, "Width of the line", "M")->needs(line);
  command->add_option("--note", arguments->edit.note, "Why, for people; at most 256 bytes");
  program.OnChosen(*command, arguments, AddEdit);
}

void AddOrigin(CLI::App& edit, Program& program) {
  auto* command = edit.add_subcommand("origin", "Where the building's frame begins, and how it is turned");
  command->footer(
      "Maps are exported and drawn, and poses and paths printed, in this frame with their option --frame building.\n"
      "Robots, tiles and queries go on in the frame `map`, so nothing moves. The last origin counts.\n"
      "EXAMPLES\n  cairn map edit origin --site hall --at 1.2,-3 --along-walls\n"
      "  cairn map edit origin --site hall --at 1.2,-3 --x-axis 8.4,-2.9\n"
      "  cairn map export --site hall -o hall.yaml --frame building");
  auto arguments = std::make_shared<OriginArguments>();
  command->add_option("--site", arguments->site, "The site's name")->required();
  AddPoints(*command, "--at", arguments->at, 1, 1, "The origin, in metres of the map's frame (without it 0,0)");
  auto* axis = AddPoints(*command, "--x-axis", arguments->axis, 1, 1, "A point on the x axis");
  auto* walls = command->add_flag("--along-walls", arguments->along_walls,
                                  "The x axis is along most walls of the map, as little turned as can be");
  auto* turned =
      AddNumber(*command, "--turned", arguments->turned_deg, -360.0, 360.0, "By how much it is turned", "DEG");
  walls->excludes(axis);
  turned->excludes(axis)->excludes(walls);
  command->add_option("--note", arguments->note, "Why, for people; at most 256 bytes");
  program.OnChosen(*command, arguments, SetOrigin);
}

}  // namespace

void AddMapEdit(CLI::App& map, Program& program) {
  auto* edit = map.add_subcommand("edit", "Say what is in a map, whatever robots have drawn");
  edit->require_subcommand(1);
  edit->footer(
      "Edits are a layer above the map, which stays, also after restarts, until they are removed. Where the map is\n"
      "smoothed, joined, bent by a large loop or switched to another version, an edit moves as a whole with the\n"
      "keyframes near it, and keeps its shape. Its coordinates are others then: `cairn map edit list` says which.\n"
      "Where they overlap, the later one counts. Robots that are only localised are localised in the edited map after\n"
      "some seconds, but for walls that people drew, because lidars may not see them. Robots that map do not see "
      "edits.\n"
      "EXAMPLES\n  cairn map edit erase --site hall --box 2,1 3,1.5 --note 'a pallet that is gone'\n"
      "  cairn map edit wall --site hall --line 0,4 6,4 --width 0.05 --note 'glass'\n"
      "  cairn map edit keep-out --site hall --area 8,0 10,0 10,3 9,4\n"
      "  cairn map edit origin --site hall --along-walls\n  cairn map edit list --site hall\n  cairn map edit remove "
      "--site hall --id 2");
  AddKind(*edit, program, MapEditKind::kFree, "erase", "Nothing stands here");
  AddKind(*edit, program, MapEditKind::kUnknown, "forget", "What is drawn here does not count: it is unknown");
  AddKind(*edit, program, MapEditKind::kOccupied, "wall", "Something stands here");
  AddKind(*edit, program, MapEditKind::kKeepOut, "keep-out",
          "Robots must not drive here; the map does not change (map export --keep-out)");
  AddOrigin(*edit, program);
  auto listed = std::make_shared<KnownEditArguments>();
  auto* list = edit->add_subcommand("list", "All edits of a site's map");
  list->add_option("--site", listed->site, "The site's name")->required();
  program.OnChosen(*list, listed, ListEdits);
  auto gone = std::make_shared<KnownEditArguments>();
  auto* remove = edit->add_subcommand("remove", "Take an edit back");
  remove->add_option("--site", gone->site, "The site's name")->required();
  remove->add_option("--id", gone->id, "Its number, as in `cairn map edit list`")->required();
  program.OnChosen(*remove, gone, RemoveEdit);
}

}  // namespace cairn::client
