#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "client/sim/shipped_worlds.h"
#include "server/slam/grid/grid_image.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_a/thesis_a.h"
#include "tests/studies/thesis_b/known_map.h"

namespace cairn::studies {
namespace {

constexpr int kOccupied = 65;     // Percent, as map images count.
constexpr double kOnWallM = 0.1;  // From a true wall, an occupied cell's middle.

double DistanceTo(const MapLine& line, const Eigen::Vector2d& p) {
  const Eigen::Vector2d along = line.b - line.a;
  const double share = std::clamp((p - line.a).dot(along) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
  return (p - line.a - share * along).norm();
}

struct Drawing {
  double wall_found = 0.0;   // Share of the walls ever hit that are occupied,
  double thickness_m = 0.0;  // occupied area over the length of those found,
  double off_walls = 0.0;    // share of occupied cells that lie on no wall: what was there for a moment.
  double cpu_ms = 0.0;       // A scan.
  OccupancyImage image;
};

// Points along all walls, a cell apart.
std::vector<Eigen::Vector2d> Along(const std::vector<MapLine>& walls, double step_m) {
  std::vector<Eigen::Vector2d> points;
  for (const MapLine& wall : walls) {
    const double length = (wall.b - wall.a).norm();
    for (double way = 0.5 * step_m; way < length; way += step_m)
      points.push_back(wall.a + way / length * (wall.b - wall.a));
  }
  return points;
}

Drawing Draw(const StudyLog& log, const std::vector<MapLine>& walls, const std::vector<Eigen::Vector2d>& seen,
             const slam::GridOptions& options) {
  slam::OccupancyGrid grid(options);
  std::size_t next = 0;
  const Stopwatch watch;
  for (const LogRecord& record : log.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr || next >= log.truth.size()) continue;
    grid.Draw(*scan, log.truth[next++].T_map_robot);
  }
  Drawing drawing;
  drawing.cpu_ms = watch.CpuMs() / static_cast<double>(std::max<std::size_t>(next, 1));
  const auto occupied = [&](const Eigen::Vector2d& p) {
    const std::uint8_t percent = grid.OccupancyAt(p);
    return percent != kUnknownCell && percent >= kOccupied;
  };
  // A wall lies on the border of cells as often as not: either side will do.
  const double half = 0.5 * options.resolution_m;
  std::size_t found = 0;
  for (const Eigen::Vector2d& p : seen)
    for (const Eigen::Vector2d& by : {Eigen::Vector2d(0, 0), Eigen::Vector2d(half, 0), Eigen::Vector2d(-half, 0),
                                      Eigen::Vector2d(0, half), Eigen::Vector2d(0, -half)})
      if (occupied(p + by)) {
        ++found;
        break;
      }
  drawing.image = slam::ImageOf(grid);
  std::size_t cells = 0, off = 0;
  for (int y = 0; y < drawing.image.height; ++y) {
    for (int x = 0; x < drawing.image.width; ++x) {
      const std::uint8_t percent = drawing.image.cells[static_cast<std::size_t>(y * drawing.image.width + x)];
      if (percent == kUnknownCell || percent < kOccupied) continue;
      ++cells;
      const Eigen::Vector2d middle = drawing.image.T_map_origin * Eigen::Vector2d((x + 0.5) * options.resolution_m,
                                                                                  (y + 0.5) * options.resolution_m);
      const bool on_wall = std::ranges::any_of(
          walls, [&](const MapLine& wall) { return DistanceTo(wall, middle) < kOnWallM + options.hit_spread_m; });
      off += on_wall ? 0 : 1;
    }
  }
  drawing.wall_found = static_cast<double>(found) / static_cast<double>(std::max<std::size_t>(seen.size(), 1));
  drawing.thickness_m = static_cast<double>(cells - off) * options.resolution_m * options.resolution_m /
                        std::max(static_cast<double>(found) * options.resolution_m, 1e-9);
  drawing.off_walls = static_cast<double>(off) / static_cast<double>(std::max<std::size_t>(cells, 1));
  return drawing;
}

}  // namespace

void StudyGridModels(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Occupancy grids (3.7)");
  report.Text(
      "One robot drives through the simulated building, where people walk; every scan is drawn at its true pose, so "
      "that what differs is the way to draw. The thesis spread hits by a triangular density, found its walls too "
      "thick, "
      "and went down to deterministic cells of which an occupied one is hard to free (triangular and degrading here); "
      "probabilistic is our default, deterministic lets the last scan decide. *Walls found*: share of the walls' "
      "length "
      "ever hit that is occupied. *Thickness*: occupied area at walls by that length. *On no wall*: occupied cells "
      "where no wall is: posts, which are the same in every row, and what people have left behind.");
  sim::FleetOptions fleet;
  fleet.seed = context.seed;
  fleet.scan_hz = 5.0;
  fleet.laser.error.sigma_m = 0.02;
  const auto world = sim::OpenWorld("building");
  const std::vector<MapLine> walls = KnownMapOf(*world);
  const StudyLog log = SimulateLog("building", context.Pick(240.0, 60.0), fleet);

  using slam::GridModel;
  const std::vector<std::pair<GridModel, std::string>> models{{GridModel::kProbabilistic, "probabilistic (default)"},
                                                              {GridModel::kDeterministic, "deterministic"},
                                                              {GridModel::kTriangular, "triangular (printed first)"},
                                                              {GridModel::kDegrading, "degrading (printed)"}};
  // What was hit at all: a grid that never forgets.
  slam::GridOptions never;
  never.model = GridModel::kDegrading;
  never.miss_probability = 0.4999;
  slam::OccupancyGrid hit(never);
  std::size_t next = 0;
  for (const LogRecord& record : log.records)
    if (const auto* scan = std::get_if<Scan>(&record); scan != nullptr && next < log.truth.size())
      hit.Draw(*scan, log.truth[next++].T_map_robot);
  std::vector<Eigen::Vector2d> seen = Along(walls, never.resolution_m);
  std::erase_if(seen, [&](const Eigen::Vector2d& p) {
    const std::uint8_t percent = hit.OccupancyAt(p);
    return percent == kUnknownCell || percent < kOccupied;
  });

  Table table({"model", "walls found", "thickness (m)", "on no wall", "CPU a scan (ms)"});
  for (const auto& [model, name] : models) {
    slam::GridOptions options;
    options.model = model;
    const Drawing drawing = Draw(log, walls, seen, options);
    table.Add({name, Percent(drawing.wall_found), Number(drawing.thickness_m, 3), Percent(drawing.off_walls),
               Number(drawing.cpu_ms, 2)});
    report.AddMap(drawing.image, {.title = "Building, " + name, .x = {"x", "m"}, .y = {"y", "m"}, .equal_scale = true},
                  "grid-" + name.substr(0, name.find(' ')));
  }
  report.Add(table, "grid_models");
}

}  // namespace cairn::studies
