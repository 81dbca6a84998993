#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/progress_line.h"
#include "client/cli/quantity_text.h"
#include "client/cli/record_source.h"
#include "client/cli/recorder.h"
#include "client/cli/ros2_source.h"
#include "client/lib/map_client.h"
#include "common/wall_clock.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMebibyte = 1024.0 * 1024.0;

struct RecordArguments {
  std::string file;
  bool force = false;
  bool no_scans = false;
  RecorderOptions what;
  std::optional<double> seconds;
  double max_mib = 0.0;  // 0: no limit.
  double map_every_s = 5.0;
  double buffer_mib = 64.0;
};

// The map of one site, written when it has changed, and not too often.
class RecordedMap {
 public:
  RecordedMap(std::string site, std::unique_ptr<MapClient> map) : site_(std::move(site)), map_(std::move(map)) {}

  // `soon`: also where the last one was written just now.
  [[nodiscard]] Result<void> Write(RecordingFile& file, double every_s, bool soon) {
    const auto now = Clock::now();
    if (!soon && now - written_ < std::chrono::duration<double>(every_s)) return {};
    const TileChanges changes = map_->ChangesSince(place_);
    const auto info = map_->info();
    if (changes.changed.empty() || !info) return {};
    place_ = changes.now;
    written_ = now;
    const int level = LevelFor(*info);
    if (level >= kPyramidLevels) return SayOnce(file, "the map is too large to be recorded");
    std::vector<Tile> tiles = map_->tiles(level);
    for (Tile& tile : tiles) tile.key.level = 0;  // As if there were no finer cells.
    const auto image = AssembleTiles(tiles, info->resolution_m * (1 << level));
    if (!image) return SayOnce(file, "the map cannot be recorded: " + image.error().message);
    if (image->cells.empty()) return {};
    return file.Add(site_, *image, WallClock());
  }

 private:
  // The finest level of which the whole map has not too many cells: a message must not be much larger than a chunk.
  [[nodiscard]] static int LevelFor(const MapInfo& info) {
    constexpr double kMostCells = 8.0 * kMebibyte;
    double cells =
        (info.x_max_m - info.x_min_m) * (info.y_max_m - info.y_min_m) / (info.resolution_m * info.resolution_m);
    int level = 0;
    for (; level < kPyramidLevels && !(cells <= kMostCells); ++level) cells /= 4.0;
    return level;
  }
  [[nodiscard]] Result<void> SayOnce(RecordingFile& file, const std::string& text) {
    if (std::exchange(said_, true)) return {};
    return file.AddLog(bag::LogLevel::kWarning, site_, text, WallClock());
  }

  const std::string site_;
  const std::unique_ptr<MapClient> map_;
  TileChanges::Place place_;
  Clock::time_point written_{};
  bool said_ = false;
};

// One run of the command, from the first subscription to the end of the file.
class Recording {
 public:
  Recording(wire::Bus& bus, const RecordArguments& arguments)
      : bus_(bus), arguments_(arguments), queue_(static_cast<std::size_t>(arguments.buffer_mib * kMebibyte)) {}

  [[nodiscard]] Result<void> Begin() {
    RecordSourceOptions options;
    options.samples = !arguments_.no_scans;
    for (const std::string& robot : arguments_.what.robots) options.robots.insert(HashName(robot));
    auto source = RecordSource::Create(bus_, queue_, options);
    if (!source && source.error().code == StatusCode::kPermissionDenied && options.samples) {
      return Fail(source.error().code, source.error().message +
                                           ": scans are for recorders (make-fleet.sh --recorders); --no-scans leaves "
                                           "them out");
    }
    if (!source) return tl::unexpected(source.error());
    source_ = *std::move(source);
    if (options.samples) {
      auto ros2 = Ros2Source::Create(bus_, queue_, options.robots);
      if (!ros2) return tl::unexpected(ros2.error());
      ros2_ = *std::move(ros2);
    }
    auto file = RecordingFile::Create(arguments_.file, arguments_.force);
    if (!file && file.error().code == StatusCode::kAlreadyExists)
      return Fail(file.error().code, arguments_.file + " exists; --force overwrites it");
    if (!file) return tl::unexpected(file.error());
    file_ = *std::move(file);
    recorder_.emplace(*file_, arguments_.what);
    return {};
  }

  // Writes what has arrived; waits a little where nothing has.
  [[nodiscard]] Result<void> Step() {
    constexpr std::chrono::milliseconds kWait{50};
    if (auto taken = TakeAll(kWait); !taken) return taken;
    if (auto written = WriteMaps(false); !written) return written;
    return file_->EndOldChunk(WallClock());
  }

  [[nodiscard]] Result<void> End() {
    source_.reset();
    if (ros2_ != nullptr) ros2_problem_ = ros2_->problem();
    ros2_.reset();
    if (auto taken = TakeAll(std::chrono::milliseconds(0)); !taken) return taken;
    if (auto written = WriteMaps(true); !written) return written;
    if (const std::string losses = Losses(); !losses.empty())
      if (auto said = file_->AddLog(bag::LogLevel::kWarning, "recorder", losses, WallClock()); !said) return said;
    return file_->Finish();
  }

  [[nodiscard]] bool full() const {
    return arguments_.max_mib > 0.0 && static_cast<double>(file_->bytes()) >= arguments_.max_mib * kMebibyte;
  }
  [[nodiscard]] int scan_writers() const { return source_ ? source_->scan_writers() : 0; }

  [[nodiscard]] std::string Counts() const {
    const RecordingFile::Counts& counts = file_->counts();
    return fmt::format("{} scans, {} odometry, {} poses, {} maps, {:.1f} MiB", counts.scans, counts.odometry,
                       counts.poses, counts.maps, static_cast<double>(file_->bytes()) / kMebibyte);
  }
  // What is not in the file although it was meant to be; empty where nothing is missing.
  [[nodiscard]] std::string Losses() const {
    const auto left_out = queue_.left_out();
    const auto account = recorder_->account();
    std::string text;
    const auto add = [&](std::uint64_t count, const std::string& what) {
      if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : "; ", count, what);
    };
    add(left_out.scans, "scans left out because the disk was too slow");
    add(left_out.others, "other samples left out because the disk was too slow");
    add(account.missing, "samples did not arrive");
    add(account.nameless, "samples of robots or sensors that the server does not know");
    add(file_->counts().without_topic, "messages left out because there are too many topics");
    const std::string ros2 = ros2_ != nullptr ? ros2_->problem() : ros2_problem_;
    if (!ros2.empty()) text += (text.empty() ? "" : "; ") + std::string("scans of robots on ROS 2: ") + ros2;
    return text;
  }
  [[nodiscard]] nlohmann::json Json() const {
    const RecordingFile::Counts& counts = file_->counts();
    const auto account = recorder_->account();
    return {{"file", arguments_.file},       {"bytes", file_->bytes()},
            {"scans", counts.scans},         {"odometry", counts.odometry},
            {"poses", counts.poses},         {"maps", counts.maps},
            {"log_lines", counts.log_lines}, {"robots", recorder_->robots()},
            {"sites", recorder_->sites()},   {"left_out_scans", queue_.left_out().scans},
            {"missing", account.missing},    {"left_out_others", queue_.left_out().others},
            {"repeated", account.repeated},  {"nameless", account.nameless}};
  }
  // The robots of which something is in the file; if there are none, the sites whose maps are. Empty where nothing is.
  [[nodiscard]] std::string Subjects() const {
    const std::vector<std::string> robots = recorder_->robots();
    if (!robots.empty()) return fmt::format(" of {}", fmt::join(robots, ", "));
    if (file_->counts().maps == 0) return {};
    const std::set<std::string>& sites = recorder_->sites();
    return fmt::format(" of {} {}", sites.size() == 1 ? "site" : "sites", fmt::join(sites, ", "));
  }

 private:
  [[nodiscard]] Result<void> TakeAll(std::chrono::milliseconds wait) {
    for (RecordEvent& event : queue_.Take(wait))
      if (auto taken = recorder_->Take(std::move(event)); !taken) return taken;
    return {};
  }

  [[nodiscard]] Result<void> WriteMaps(bool soon) {
    for (const std::string& site : recorder_->sites()) {
      if (maps_.count(site) > 0) continue;
      auto map = MapClient::Create(bus_, site);
      if (!map) return tl::unexpected(map.error());
      maps_.try_emplace(site, site, *std::move(map));
    }
    for (auto& [site, map] : maps_)
      if (auto written = map.Write(*file_, arguments_.map_every_s, soon); !written) return written;
    return {};
  }

  wire::Bus& bus_;
  const RecordArguments& arguments_;
  RecordQueue queue_;
  std::unique_ptr<RecordingFile> file_;
  std::optional<Recorder> recorder_;
  std::map<std::string, RecordedMap> maps_;
  std::unique_ptr<RecordSource> source_;
  std::unique_ptr<Ros2Source> ros2_;
  std::string ros2_problem_;  // Of the source when it ended.
};

ExitCode Record(Program& program, const RecordArguments& arguments) {
  // Who starts it without a server would record nothing and not know it.
  if (const auto server = program.Ask([](QueryClient& queries) { return queries.Ping(); }); !server)
    return program.Refuse(server.error());
  const auto bus = program.bus();
  if (!bus) return program.Refuse(bus.error());
  Recording recording(**bus, arguments);
  if (const auto begun = recording.Begin(); !begun) return program.Refuse(begun.error());

  const auto start = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
  ProgressLine progress(program.err(), ErrorIsTerminal(), program.options.json);
  const auto show = [&] {
    const std::string losses = recording.Losses();
    return fmt::format("{}: {} (streams of scans: {}){}{}", FormatDuration(seconds()), recording.Counts(),
                       recording.scan_writers(), losses.empty() ? "" : "; ", losses);
  };
  Result<void> written;
  while (written && !Interrupted() && !recording.full() && (!arguments.seconds || seconds() < *arguments.seconds)) {
    written = recording.Step();
    progress.Show(seconds(), -1.0, show());
  }
  if (written) written = recording.End();
  progress.Finish(seconds(), -1.0, show());

  const std::string losses = recording.Losses();
  std::string text = fmt::format("{}: {}{} in {}\n", arguments.file, recording.Counts(), recording.Subjects(),
                                 FormatDuration(seconds()));
  if (!losses.empty()) text += "not recorded: " + losses + "\n";
  nlohmann::json object = recording.Json();
  object["seconds"] = seconds();
  if (!written) object["error"] = written.error();
  program.Print(text, object);
  if (!written) {
    program.err() << "cairn: " << written.error().message << " (" << StatusCodeName(written.error().code)
                  << "); what was written before can be read\n";
  }
  return written ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace

void AddRecord(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("record", "Record robots, poses and maps as MCAP for Foxglove, until Ctrl-C");
  command->footer(
      "Writes scans, odometry, the server's poses, the maps of the sites as they change, and a log of what happens. "
      "The\n"
      "file opens in Foxglove, and replay, check-log and cairn-offline read it as a log. It only listens, and a\n"
      "recorder that is killed leaves a file that can be read up to its last two seconds. Robots that come later are\n"
      "recorded too, and so are robots on ROS 2, whose domain the recorder joins as a reader.\n"
      "EXAMPLES\n  cairn record monday.mcap\n  cairn record r1.mcap --robot r1 --seconds 60\n"
      "  cairn record hall.mcap --site hall --map-every 30 --max-mib 2000\n"
      "  cairn-offline monday.mcap --scan-topic /robots/r1/scan/laser --map map.yaml");
  auto arguments = std::make_shared<RecordArguments>();
  command->add_option("file", arguments->file, "The new file")->required()->type_name("FILE.mcap");
  command->add_flag("--force", arguments->force, "Overwrite a file that exists");
  command->add_option("--robot", arguments->what.robots, "Only this robot, and the map of its site; may be repeated")
      ->type_name("ROBOT")
      ->allow_extra_args(false);
  command->add_option("--site", arguments->what.sites, "Only this site: its map and its robots; may be repeated")
      ->type_name("SITE")
      ->allow_extra_args(false);
  command->add_flag("--no-scans", arguments->no_scans,
                    "Without scans and odometry: with DDS Security, a viewer may not read them");
  AddParsed(*command, "--seconds", arguments->seconds, ParseDuration, "End after this time", "SECONDS");
  AddNumber(*command, "--max-mib", arguments->max_mib, 0.0, 1e9, "End when the file has this size; 0: no limit", "MIB");
  AddNumber(*command, "--map-every", arguments->map_every_s, 0.1, 1e6,
            "Write a map that has changed, but not more often than this", "SECONDS");
  AddNumber(*command, "--buffer-mib", arguments->buffer_mib, 1.0, 65536.0,
            "What may wait for the disk; more is left out and counted", "MIB");
  program.OnChosen(*command, arguments, Record);
}

}  // namespace cairn::client
