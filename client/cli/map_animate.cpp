#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/animation.h"
#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/map_picture.h"
#include "client/cli/option_checks.h"
#include "client/cli/progress_line.h"
#include "client/cli/quantity_text.h"
#include "common/map/png_codec.h"

namespace cairn::client {
namespace {

struct AnimateArguments {
  std::string site;
  std::vector<std::string> robots;
  double every_s = 1.0;
  int frames = 60;
  std::optional<double> seconds;  // Until interrupted.
  std::string output;
  PictureOptions picture;
};

// What the map and the paths were at one moment. The map is kept compressed, because all of them wait until the last
// one says how large the picture has to be.
struct MapMoment {
  OccupancyImage place;  // Without its cells.
  std::vector<std::uint8_t> cells_png;
  std::vector<PicturePath> paths;
};

// The finest level whose map has at most twice as many cells across as the picture has pixels.
std::uint32_t LevelForWidth(const MapInfo& info, int width_px) {
  const double cells = std::max(info.x_max_m - info.x_min_m, (info.y_max_m - info.y_min_m) / 2.0) / info.resolution_m;
  std::uint32_t level = 0;
  while (level + 1 < kPyramidLevels && cells / static_cast<double>(1U << level) > 2.0 * width_px) ++level;
  return level;
}

// More points than that are not seen.
Trajectory Thinned(Trajectory path) {
  constexpr std::size_t kMostPoses = 2000;
  const std::size_t step = path.size() / kMostPoses + 1;
  if (step == 1) return path;
  Trajectory thin;
  for (std::size_t i = 0; i + 1 < path.size(); i += step) thin.push_back(path[i]);
  thin.push_back(path.back());
  return thin;
}

class GrowingMap {
 public:
  explicit GrowingMap(const AnimateArguments& arguments) : arguments_(arguments), every_s_(arguments.every_s) {}

  // Keeps what the server says now. Fails where the site has no map yet, or where there is no answer.
  [[nodiscard]] Result<void> Look(Program& program) {
    const auto info = program.Ask([&](QueryClient& server) { return server.Map(arguments_.site); });
    if (!info) return tl::unexpected(info.error());
    const std::uint32_t level = LevelForWidth(*info, arguments_.picture.width_px);
    auto map = program.Ask([&](QueryClient& server) { return server.MapImage(arguments_.site, level); });
    if (!map) return tl::unexpected(map.error());
    MapMoment moment;
    for (const std::string& robot : arguments_.robots) {
      // One that has not come yet has no path.
      auto path = program.Ask([&](QueryClient& server) { return server.Path(robot); });
      moment.paths.push_back({robot, path ? Thinned(std::move(path->poses)) : Trajectory{}, false});
    }
    frame_.Include(FrameOf(*map, moment.paths, arguments_.picture.margin_m));
    RasterImage cells{map->width, map->height, 1, std::exchange(map->cells, {})};
    auto png = EncodePng(cells);
    if (!png) return tl::unexpected(png.error());
    moment.place = std::move(*map);
    moment.cells_png = std::move(*png);
    bytes_ += moment.cells_png.size();
    if (moments_.size() >= static_cast<std::size_t>(arguments_.frames) || bytes_ > kMostBytes) LeaveOutEverySecond();
    moments_.push_back(std::move(moment));
    return {};
  }

  // Time between two frames, now.
  [[nodiscard]] double every_s() const { return every_s_; }
  [[nodiscard]] std::size_t frames() const { return moments_.size(); }

  [[nodiscard]] Result<std::vector<std::uint8_t>> Draw() const {
    constexpr int kShown_ms = 150, kLastShown_ms = 2500, kShades = 4;
    PictureOptions picture = arguments_.picture;
    picture.frame = frame_;
    picture.shades = kShades;
    Animation animation;
    for (const MapMoment& moment : moments_) {
      OccupancyImage map = moment.place;
      auto cells = DecodeGreyPng(moment.cells_png, {map.width, map.height});
      if (!cells) return tl::unexpected(cells.error());
      map.cells = std::move(*cells);
      auto pixels = DrawMapPixels(map, moment.paths, picture);
      if (!pixels) return tl::unexpected(pixels.error());
      const bool last = &moment == &moments_.back();
      if (auto added = animation.Add(std::move(*pixels), last ? kLastShown_ms : kShown_ms); !added)
        return tl::unexpected(added.error());
    }
    return animation.File();
  }

 private:
  static constexpr std::size_t kMostBytes = std::size_t{256} << 20;

  // However long it takes, the frames are evenly spread over the time, and not more than they may be.
  void LeaveOutEverySecond() {
    std::vector<MapMoment> kept;
    bytes_ = 0;
    for (std::size_t i = 0; i < moments_.size(); i += 2) {
      bytes_ += moments_[i].cells_png.size();
      kept.push_back(std::move(moments_[i]));
    }
    moments_ = std::move(kept);
    every_s_ *= 2.0;
  }

  const AnimateArguments& arguments_;
  double every_s_;
  PictureFrame frame_;  // Everything that any frame shows.
  std::size_t bytes_ = 0;
  std::vector<MapMoment> moments_;
};

ExitCode AnimateMap(Program& program, const AnimateArguments& arguments) {
  using Clock = std::chrono::steady_clock;
  if (const auto allowed = CheckPictureFile(arguments.output); !allowed) return program.Refuse(allowed.error());
  // Who starts it without a server would wait for a map in vain.
  if (const auto server = program.Ask([](QueryClient& queries) { return queries.Ping(); }); !server)
    return program.Refuse(server.error());
  const double most_s = std::min(arguments.seconds.value_or(1e9), 1e9);
  const auto after = [](Clock::time_point from, double seconds) {
    return from + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  };
  const auto begin = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  GrowingMap map(arguments);
  ProgressLine progress(program.err(), ErrorIsTerminal(), program.options.json);
  int missed = 0;
  auto next = begin;
  for (;;) {
    const auto looked = map.Look(program);
    if (!looked && map.frames() > 0) ++missed;
    progress.Show(seconds(), -1.0, fmt::format("{}: {} frames", FormatDuration(seconds()), map.frames()));
    const bool over = Interrupted() || seconds() >= most_s;
    if (over && map.frames() == 0 && !looked) return program.Refuse(looked.error());
    if (over) break;
    // An answer that comes late makes no hurry afterwards.
    next = std::max(after(next, map.every_s()), Clock::now());
    WaitUntil(std::min(next, after(begin, most_s)));
  }
  progress.Finish(seconds(), -1.0, fmt::format("{}: {} frames", FormatDuration(seconds()), map.frames()));
  const auto file = map.Draw();
  if (!file) return program.Refuse(file.error());
  if (const auto written = WritePictureFile(arguments.output, *file); !written) return program.Refuse(written.error());
  std::string text = fmt::format("{}: {} frames, {} KiB\n", arguments.output, map.frames(), file->size() / 1024);
  if (missed > 0) text += fmt::format("{} frames are missing, because the server did not answer\n", missed);
  return program.Print(
      text, {{"file", arguments.output}, {"frames", map.frames()}, {"missed", missed}, {"bytes", file->size()}});
}

}  // namespace

void AddMapAnimate(CLI::App& map, Program& program) {
  auto* command = map.add_subcommand("animate", "Watch a map grow and draw that as an animated picture");
  command->footer(
      "Looks at the map until Ctrl-C, then writes an animated PNG, which browsers play. Programs that do not know "
      "this\n"
      "format show the last picture. Where there are more than --frames, every second one is left out, and from then\n"
      "on it looks half as often.\n"
      "EXAMPLES\n  cairn map animate --site hall --robots robot1 robot2 -o hall-grows.png\n"
      "  cairn map animate --site hall --every 10 --seconds 1h -o hall-grows.png");
  auto arguments = std::make_shared<AnimateArguments>();
  arguments->picture.width_px = 900;
  command->add_option("--site", arguments->site, "The site's name; it may come later")->required();
  command->add_option("--robots", arguments->robots, "Robots whose paths are drawn, too");
  AddNumber(*command, "--every", arguments->every_s, 0.1, 3600.0, "Time between two frames", "SECONDS");
  AddNumber(*command, "--frames", arguments->frames, 2, 500, "Most frames of the picture", "N");
  AddParsed(*command, "--seconds", arguments->seconds, ParseDuration, "End after this time", "SECONDS");
  command->add_option("-o,--output", arguments->output, "The PNG file to write")->required()->type_name("FILE");
  AddNumber(*command, "--width", arguments->picture.width_px, 200, 2000, "Pixels across", "PIXELS");
  command->add_option("--title", arguments->picture.title, "Title above the map");
  program.OnChosen(*command, arguments, AnimateMap);
}

}  // namespace cairn::client
