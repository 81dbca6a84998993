// cairn-study furniture: furniture is moved between two runs. How often must a robot of today pass the place where a
// piece stood until the joint map does not show it any more, and is what was brought there shown? With one and with
// several runs before; and, for comparison, if the runs before counted as much as the one of today. The same where the
// robots that drew it have not ended, as in a fleet that drives day and night. Then doors that open and close
// (doors.cpp), and people who walk (people.cpp). --only moved, --only doors, --only people: one part.
#include "client/sim/furniture.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/shipped_worlds.h"
#include "common/map/occupancy_image.h"
#include "server/maps/joint_map.h"
#include "server/maps/maps_options.h"
#include "server/slam/scan_pipeline.h"
#include "tests/studies/furniture/doors.h"
#include "tests/studies/furniture/people.h"
#include "tests/studies/logs.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr int kPasses = 5;                    // That are told apart.
constexpr double kPassM = 4.0, kGoneM = 6.0;  // A pass: seen from nearer than the one, then left behind.
constexpr std::uint8_t kOccupied = 65;
constexpr int kPieces = 60;

using Chunks = slam::OccupancyGrid::Chunks;

// A place where a piece of furniture stands or stood.
struct Place {
  sim::Disc disc;
  int passes = 0;
  bool near = false;
};

bool Sees(const sim::Surroundings& surroundings, const Pose2& robot, const sim::Disc& disc) {
  constexpr double kLaserHeightM = 0.3;
  const Eigen::Vector2d between = disc.center_map - robot.translation();
  const double away = between.norm();
  const Eigen::Vector2d d = between / away;
  return away < kPassM &&
         surroundings.scene->Cast({robot.x, robot.y, kLaserHeightM}, {d.x(), d.y(), 0.0}, away) >= away - disc.radius_m;
}

bool IsDrawn(const server::JointMap& map, const sim::Disc& disc, double resolution_m) {
  const auto cell_of = [&](double coordinate_m) { return static_cast<int>(std::floor(coordinate_m / resolution_m)); };
  const double reach_m = disc.radius_m + resolution_m;
  const Eigen::Vector2d low = disc.center_map.array() - reach_m, high = disc.center_map.array() + reach_m;
  int occupied = 0;
  for (int y = cell_of(low.y()); y <= cell_of(high.y()); ++y) {
    for (int x = cell_of(low.x()); x <= cell_of(high.x()); ++x) {
      const Eigen::Vector2d centre = resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      if ((centre - disc.center_map).norm() > disc.radius_m + 0.5 * resolution_m) continue;
      const auto tile = map.cells().find({0, FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)});
      if (tile == map.cells().end()) continue;
      const int column = x - tile->first.x * kTileCells, row = y - tile->first.y * kTileCells;
      const std::uint8_t cell = (*tile->second)[static_cast<std::size_t>(row * kTileCells + column)];
      occupied += cell != kUnknownCell && cell >= kOccupied ? 1 : 0;
    }
  }
  return occupied >= 2;
}

// Maps a drive, and calls `visit` once a second with the true pose and the grid.
template <typename Visit>
Chunks Map(const StudyLog& log, const slam::MapperOptions& options, const Visit& visit) {
  slam::ScanPipeline pipeline(
      options, log.T_map_robot_start, slam::SerialFor,
      {.used = [](const Scan&, const slam::ScanOutcome&) {}, .dropped = [](const Scan&, DropReason) {}});
  Stamp next = 0;
  for (const LogRecord& record : log.records) {
    if (const auto* const odometry = std::get_if<Odometry>(&record)) {
      pipeline.Add(*odometry);
      continue;
    }
    const auto& scan = std::get<Scan>(record);
    pipeline.Add(std::make_shared<const Scan>(scan));
    if (scan.stamp < next) continue;
    next = scan.stamp + StampFromSeconds(1.0);
    if (const auto truth = PoseOn(log.truth, scan.stamp, 0.5)) visit(*truth, pipeline.mapper());
  }
  return pipeline.mapper().ShareGrid();
}

StudyLog Drive(const std::string& world, double seconds, std::uint64_t seed, std::uint64_t furniture_seed) {
  sim::FleetOptions fleet;
  fleet.seed = seed;
  fleet.furniture = {.pieces = kPieces, .seed = furniture_seed};
  return SimulateLog(world, seconds, fleet);
}

// After so many passes.
struct Drawn {
  int places = 0, drawn = 0;

  [[nodiscard]] std::string share() const { return places == 0 ? "-" : Percent(static_cast<double>(drawn) / places); }
};
struct Tally {
  std::map<int, Drawn> moved;    // After so many passes.
  Drawn brought;                 // After one pass.
  OccupancyImage before, after;  // The joint map, before and after the drive of today.
};

OccupancyImage ImageOf(const server::JointMap& map, double resolution_m) {
  std::vector<Tile> tiles;
  for (const auto& [key, cells] : map.cells()) {
    if (key.level != 0) continue;
    tiles.push_back({.key = key, .encoding = TileEncoding::kRaw, .bytes = EncodeCells(*cells, TileEncoding::kRaw)});
  }
  auto image = AssembleTiles(tiles, resolution_m);
  if (!image) throw std::runtime_error(image.error().message);
  return *std::move(image);
}

// Those that each of the runs shows.
std::vector<Place> DrawnByAll(std::vector<Place> places, const std::vector<Chunks>& runs, double resolution_m) {
  for (const Chunks& run : runs) {
    server::JointMap map(server::MapsOptions{}.past_probability);
    map.Replace(1, run);
    map.Render();
    std::erase_if(places, [&](const Place& place) { return !IsDrawn(map, place.disc, resolution_m); });
  }
  return places;
}

// What the joint map knows of the robots that have drawn before.
enum class Before : std::uint8_t {
  kEnded = 0,  // Their sessions have ended.
  kGoOn,       // They go on, elsewhere; the robot of today is known to look later.
  kSameTime,   // They go on, and when anybody has looked is not known.
};
constexpr Before kBefore[] = {Before::kEnded, Before::kGoOn, Before::kSameTime};

std::string NameOf(Before before) {
  if (before == Before::kEnded) return "has ended";
  return before == Before::kGoOn ? "goes on" : "counts as today";
}

// The robot of today drives; what it has passed is looked at when it has gone on.
Tally Today(const sim::Surroundings& surroundings, const std::vector<Chunks>& past, Before before,
            const StudyLog& today, std::vector<Place> moved, std::vector<Place> brought,
            const slam::MapperOptions& options) {
  server::JointMap map(server::MapsOptions{}.past_probability);
  const auto me = static_cast<server::SessionId>(past.size() + 1);
  for (std::size_t i = 0; i < past.size(); ++i) {
    map.Replace(i + 1, past[i]);
    if (before == Before::kEnded) map.SetPast(i + 1);
  }
  map.Render();
  Tally tally;
  tally.before = ImageOf(map, options.grid.resolution_m);
  const auto passes = [&surroundings](std::vector<Place>& places, const Pose2& robot, const auto& passed) {
    for (Place& place : places) {
      const double away = (place.disc.center_map - robot.translation()).norm();
      if (place.near && away > kGoneM) {
        place.near = false;
        passed(place.disc, ++place.passes);
      }
      place.near = place.near || Sees(surroundings, robot, place.disc);
    }
  };
  Map(today, options, [&](const Pose2& robot, slam::Mapper& mapper) {
    bool drawn_now = false;
    const auto look = [&](const sim::Disc& disc, Drawn& count) {
      if (!std::exchange(drawn_now, true)) {
        const slam::OccupancyGrid::Change change = mapper.TakeGridChange();
        slam::OccupancyGrid::Looks looks = mapper.TakeGridLooks();
        if (before == Before::kSameTime) looks.clear();
        map.Apply({.session = me, .chunks = change, .looks = std::move(looks)});
        map.Render();
      }
      ++count.places;
      count.drawn += IsDrawn(map, disc, options.grid.resolution_m) ? 1 : 0;
    };
    passes(moved, robot, [&](const sim::Disc& disc, int pass) {
      if (pass <= kPasses) look(disc, tally.moved[pass]);
    });
    passes(brought, robot, [&](const sim::Disc& disc, int pass) {
      if (pass == 1) look(disc, tally.brought);
    });
  });
  tally.after = ImageOf(map, options.grid.resolution_m);
  return tally;
}

// The map before and after the drive of today, with a mark where furniture stood and where it stands now.
void DrawBeforeAndAfter(const std::string& world, const Tally& tally, const std::vector<Place>& moved,
                        const std::vector<Place>& brought, Report& report) {
  const Pose2& origin = tally.after.T_map_origin;
  const Eigen::Vector2d size_m = tally.after.resolution_m * Eigen::Vector2d(tally.after.width, tally.after.height);
  const Eigen::AlignedBox2d mapped(origin.translation(), origin.translation() + size_m);
  const auto marks = [&mapped](const std::vector<Place>& places, const std::string& label) {
    Series series{.label = label, .mark = Mark::kPoints};
    for (const Place& place : places) {
      if (!mapped.contains(place.disc.center_map)) continue;
      series.x.push_back(place.disc.center_map.x());
      series.y.push_back(place.disc.center_map.y());
    }
    return series;
  };
  Plot plot{.title = world + ", before today's drive", .x = {"x", "m"}, .y = {"y", "m"}};
  plot.series = {marks(moved, "stood here"), marks(brought, "stands here now")};
  report.AddMap(tally.before, plot, world + "-before");
  plot.title = world + ", after today's drive";
  report.AddMap(tally.after, plot, world + "-after");
}

// The pieces of `here` beside which none of `there` stands.
std::vector<Place> Apart(const std::vector<sim::Post>& here, const std::vector<sim::Post>& there) {
  std::vector<Place> apart;
  for (const sim::Post& post : here) {
    const bool free = std::all_of(there.begin(), there.end(), [&](const sim::Post& other) {
      const double between = (other.disc.center_map - post.disc.center_map).norm();
      return between > other.disc.radius_m + post.disc.radius_m + 0.3;
    });
    if (free) apart.push_back({post.disc});
  }
  return apart;
}

void StudyMovedFurniture(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Furniture that was moved between two runs");
  slam::MapperOptions options;
  options.seed = static_cast<std::int64_t>(context.seed);
  std::vector<std::string> columns = {"world", "runs before", "the past", "pieces"};
  for (int pass = 1; pass <= kPasses; ++pass) columns.push_back("after " + Count(pass));
  columns.push_back("brought, after 1");
  Table table(columns);
  for (const std::string world : {"office", "building", "storey"}) {
    const auto surroundings = sim::OpenSurroundings(world);
    if (!surroundings) throw std::invalid_argument(surroundings.error().message);
    const auto before = sim::FurnitureIn(*surroundings, {.pieces = kPieces, .seed = context.seed});
    const auto after = sim::FurnitureIn(*surroundings, {.pieces = kPieces, .seed = context.seed + 1});
    const double seconds = context.Pick(1500.0, 300.0);
    std::vector<Chunks> past;
    for (std::uint64_t run = 0; run < 3; ++run)
      past.push_back(Map(Drive(world, seconds / 3.0, context.seed + run, context.seed), options,
                         [](const Pose2&, const slam::Mapper&) {}));
    const std::vector<Place> moved = DrawnByAll(Apart(before, after), past, options.grid.resolution_m);
    const std::vector<Place> brought = Apart(after, before);
    const StudyLog today = Drive(world, seconds, context.seed + 10, context.seed + 1);
    for (const std::size_t runs : {std::size_t{1}, std::size_t{3}}) {
      for (const Before how : kBefore) {
        const Tally tally = Today(*surroundings, {past.begin(), past.begin() + static_cast<std::ptrdiff_t>(runs)}, how,
                                  today, moved, brought, options);
        if (runs == 1 && how == Before::kEnded) DrawBeforeAndAfter(world, tally, moved, brought, report);
        std::vector<std::string> row = {world, Count(runs), NameOf(how), Count(moved.size())};
        for (int pass = 1; pass <= kPasses; ++pass) {
          const auto of_pass = tally.moved.find(pass);
          row.push_back(of_pass == tally.moved.end() ? "-" : of_pass->second.share());
        }
        row.push_back(tally.brought.share());
        table.Add(row);
        for (const auto& [pass, most] : {std::pair{3, 0.1}, std::pair{4, 0.0}}) {
          const auto drawn = tally.moved.find(pass);
          if (how == Before::kSameTime || drawn == tally.moved.end()) continue;
          report.Expect(drawn->second.drawn <= most * drawn->second.places,
                        world + ", the past " + NameOf(how) + ": " + drawn->second.share() +
                            " of what was moved is still drawn after " + Count(pass) + " passes");
        }
      }
    }
  }
  report.Add(table, "furniture");
}

void StudyFurniture(StudyContext& context) {
  if (context.Wants("moved")) StudyMovedFurniture(context);
  if (context.Wants("doors")) StudyDoors(context);
  if (context.Wants("people")) StudyPeople(context);
}

const Registration kFurniture("furniture",
                              "furniture that was moved between two runs, doors, people: what the map shows of them",
                              StudyFurniture);

}  // namespace
}  // namespace cairn::studies
