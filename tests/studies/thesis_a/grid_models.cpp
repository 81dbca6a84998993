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
constexpr double kOnWallM = 0.1;  // A cell whose middle is nearer to a true wall than this lies on the wall.

double DistanceTo(const MapLine& line, const Eigen::Vector2d& p) {
  const Eigen::Vector2d along = line.b - line.a;
  const double share = std::clamp((p - line.a).dot(along) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
  return (p - line.a - share * along).norm();
}

struct Drawing {
  double wall_found = 0.0;   // Share of the hit length of all walls that is occupied.
  double thickness_m = 0.0;  // Occupied area at the walls divided by the occupied length.
  double off_walls = 0.0;    // Share of the occupied cells that lie on no wall.
  double cpu_ms = 0.0;       // Processor time per scan.
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
  // A wall often lies on the border between two cells; then either cell may be the occupied one.
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
      "One robot drives through the simulated building, in which people walk. Every scan is drawn at "
      "its true pose, so that only the way of drawing differs. The thesis first spread each hit with a "
      "triangular density (here *triangular*), found that walls became too thick, and then used "
      "deterministic cells in which an occupied cell is hard to free (here *degrading*). "
      "*Probabilistic* is the default of Cairn; with *deterministic* the last scan decides. *Walls "
      "found* is the share of the hit length of all walls that is occupied. *Thickness* is the "
      "occupied area at the walls divided by that length. *On no wall* is the share of occupied cells "
      "where there is no wall: these are posts, which are the same in every row, and traces of people "
      "who have moved on.");
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
  // The parts of the walls that were hit at least once, from a grid whose cells practically never become free again.
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

  Table table({"model", "walls found", "thickness (m)", "on no wall", "processor time per scan (ms)"});
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
