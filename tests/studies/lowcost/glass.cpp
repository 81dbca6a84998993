// cairn-study lowcost, glass: an office with glass fronts, beside the same office with walls, or with nothing, in their
// place. A pane returns only beams near its normal, lets others through, and mirrors what grazes it.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"
#include "tests/studies/lowcost/mapped.h"
#include "tests/studies/plot.h"

namespace cairn::studies {
namespace {

constexpr double kWrongM = 0.3;       // A robot that says it is localized is nearer to the truth than this.
constexpr double kMostErrorM = 0.06;  // Smoothed, whatever the fronts are made of.
constexpr double kMostNotLocalized = 0.01;
constexpr std::uint8_t kDrawn = 65;   // Percent.
constexpr double kBesidePaneM = 0.1;  // A pane is drawn where a cell so near to it is occupied.

bool IsDrawn(const OccupancyImage& map, const Eigen::Vector2d& p_map) {
  const Eigen::Vector2d p = map.T_map_origin.Inverse() * p_map / map.resolution_m;
  const int x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return false;
  const std::uint8_t cell = map.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) + x];
  return cell >= kDrawn && cell <= 100;
}

// The share of the panes' length that the map shows as walls.
double ShareDrawn(const OccupancyImage& map, const std::vector<sim::Pane>& panes) {
  int places = 0, drawn = 0;
  for (const sim::Pane& pane : panes) {
    const Eigen::Vector2d along = pane.b_map - pane.a_map;
    const Eigen::Vector2d across = Eigen::Vector2d(-along.y(), along.x()).normalized();
    const int steps = static_cast<int>(along.norm() / map.resolution_m);
    for (int i = 0; i < steps; ++i) {
      const Eigen::Vector2d p = pane.a_map + along * ((i + 0.5) / steps);
      bool here = false;
      for (double off = -kBesidePaneM; off <= kBesidePaneM; off += map.resolution_m / 2)
        here = here || IsDrawn(map, p + off * across);
      ++places;
      drawn += here ? 1 : 0;
    }
  }
  return places > 0 ? static_cast<double>(drawn) / places : 0.0;
}

int CountWrong(const LogRun& run, const Trajectory& truth) {
  int wrong = 0;
  for (std::size_t i = 0; i < run.online.size(); ++i) {
    const auto T_map_true = PoseOn(truth, run.online[i].stamp, 1.0);
    if (run.localized[i] == 0 || !T_map_true) continue;
    wrong += (run.online[i].T_map_robot.translation() - T_map_true->translation()).norm() > kWrongM ? 1 : 0;
  }
  return wrong;
}

}  // namespace

void RunGlass(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Glass fronts");
  report.Text(
      "The world `glass`: an office whose rooms have glass fronts, and the same with walls or with nothing in their "
      "place. Errors are absolute trajectory errors. `wrong`: scans that are called localized and are more than 0.3 m "
      "from the truth. `drawn`: share of the length of the fronts that the smoothed map shows.");
  const auto world = sim::OpenWorld("glass");
  if (!world) throw std::invalid_argument(world.error().message);
  sim::World walls = *world, open = *world;
  for (const sim::Pane& pane : walls.panes) walls.segments.push_back({pane.a_map, pane.b_map});
  walls.panes.clear();
  open.panes.clear();
  const std::pair<std::string, const sim::World*> places[] = {{"glass", &*world}, {"walls", &walls}, {"none", &open}};
  Table table({"lidar", "fronts", "seed", "odometry (m)", "online (m)", "smoothed (m)", "not localized (%)", "wrong",
               "drawn (%)"});
  for (const std::string model : {"rplidar-a1", "ld19", "utm-30lx"}) {
    for (std::uint64_t seed = context.seed; seed < context.seed + context.Pick(3U, 1U); ++seed) {
      for (const auto& [fronts, place] : places) {
        sim::FleetOptions robot;
        robot.seed = seed;
        const sim::ModelledLaser lidar = *sim::WithModel(robot.laser, model);
        robot.laser = lidar.laser;
        robot.scan_hz = lidar.scan_hz;
        const StudyLog log = SimulateLog(*place, context.Pick(400.0, 60.0), robot);
        const Mapped mapped = MapLog(context, log, {});
        const double smoothed_m = TrajectoryError(mapped.smoothed, log.truth);
        const double lost = static_cast<double>(mapped.run.not_localized) /
                            static_cast<double>(std::max<std::size_t>(1, mapped.run.online.size()));
        const int wrong = CountWrong(mapped.run, log.truth);
        const std::string which = model + ", " + fronts + ", seed " + std::to_string(seed) + ": ";
        report.Expect(wrong == 0, which + "localized at a wrong place");
        report.Expect(smoothed_m <= kMostErrorM, which + "the smoothed error is too large");
        report.Expect(lost <= kMostNotLocalized, which + "not localized too often");
        table.Add({model, fronts, Count(static_cast<long long>(seed)),
                   Number(TrajectoryError(RawPath(log), log.truth), 3),
                   Number(TrajectoryError(mapped.run.online, log.truth), 3), Number(smoothed_m, 3),
                   Number(100.0 * lost, 1), Count(wrong), Number(100.0 * ShareDrawn(mapped.map, world->panes), 0)});
        if (seed == context.seed) report.AddMap(mapped.map, Plot(), "glass-" + model + "-" + fronts);
      }
    }
  }
  report.Add(table, "glass");
}

}  // namespace cairn::studies
