#include "server/slam/features/line_extraction.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "server/slam/scan/beam_points.h"
#include "tests/studies/scene.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_a/thesis_a.h"

namespace cairn::studies {
namespace {

using slam::LineFeature;

struct Quality {
  int scans = 0, visible = 0, found = 0, extracted = 0, wrong = 0, measured = 0;
  double sum_r2 = 0.0, sum_alpha2 = 0.0, cpu_ms = 0.0;

  [[nodiscard]] double true_positive() const { return 1.0 * found / std::max(visible, 1); }
  [[nodiscard]] double false_positive() const { return 1.0 * wrong / std::max(extracted, 1); }
  [[nodiscard]] double sigma_r_cm() const { return 100.0 * std::sqrt(sum_r2 / std::max(measured, 1)); }
  [[nodiscard]] double sigma_alpha_deg() const { return Degrees(std::sqrt(sum_alpha2 / std::max(measured, 1))); }
};

// Whether a line lies on a wall: nearly the same direction, near it, and overlapping with it over at least half of the
// shorter of the two.
bool Shows(const LineFeature& line, const VisibleWall& wall) {
  if (wall.length() < 1e-6) return false;
  const Eigen::Vector2d along = (wall.b_robot - wall.a_robot).normalized();
  if (std::abs(LineAngleDiff(line.slope, std::atan2(along.y(), along.x()))) > Radians(6.0)) return false;
  const Eigen::Vector2d off = line.midpoint() - wall.a_robot;
  if (std::abs(along.x() * off.y() - along.y() * off.x()) > 0.10) return false;
  const double p = along.dot(line.first - wall.a_robot), q = along.dot(line.last - wall.a_robot);
  const double overlap = std::min(std::max(p, q), wall.length()) - std::max(std::min(p, q), 0.0);
  return overlap >= 0.5 * std::min(line.length, wall.length());
}

void AddMeasured(const Scene& scene, const Pose2& pose, const sim::LaserOptions& laser, sim::Random& random,
                 Quality& quality) {
  const Scan scan = scene.Look(pose, laser, random);
  const Stopwatch watch;
  const std::vector<LineFeature> lines = slam::ExtractLines(slam::PointsOf(scan), scan, {});
  quality.cpu_ms += watch.CpuMs();
  const std::vector<VisibleWall> walls = scene.VisibleWalls(pose, laser);
  ++quality.scans;
  quality.extracted += static_cast<int>(lines.size());
  for (const VisibleWall& wall : walls) {
    if (wall.length() < 0.5 || wall.hits < 9) continue;
    ++quality.visible;
    quality.found +=
        std::any_of(lines.begin(), lines.end(), [&](const LineFeature& line) { return Shows(line, wall); });
  }
  for (const LineFeature& line : lines) {
    // A line may lie on several walls; the one with the longest overlap is taken as the truth.
    const VisibleWall* best = nullptr;
    for (const VisibleWall& wall : walls)
      if (Shows(line, wall) && (best == nullptr || wall.length() > best->length())) best = &wall;
    if (best == nullptr) {
      ++quality.wrong;
      continue;
    }
    if (line.point_count < 9) continue;
    const Eigen::Vector2d along = (best->b_robot - best->a_robot).normalized();
    const double r = std::abs(along.x() * best->a_robot.y() - along.y() * best->a_robot.x());
    ++quality.measured;
    quality.sum_r2 += std::pow(r - line.distance, 2);
    quality.sum_alpha2 += std::pow(LineAngleDiff(line.slope, std::atan2(along.y(), along.x())), 2);
  }
}

struct Row {
  std::string world;
  sim::LaserOptions laser;
};

}  // namespace

void StudyLineExtraction(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Line extraction (2.1.1, Table 2.1; 3.3)");
  report.Text(
      "The scans are simulated at random places on the robots' routes. A wall counts as visible if a "
      "scan without noise hits it at least 9 times over at least 0.5 m. A line is right if it lies on "
      "any wall of the world. The row of the thesis comes from real scans of an office that were "
      "judged by hand (Nguyen et al. 2005), so its figures are not measured in the same way. Worlds "
      "with furniture and pillars are harder than those without.");
  Table table({"scans", "world", "beams", "sigma range (cm)", "lines/100 scans", "true pos.", "false pos.",
               "sigma r (cm)", "sigma alpha (deg)", "speed (Hz)"});
  table.Add({"thesis, Table 2.1", "real office", "181", "-", "641", "86.0 %", "8.9 %", "1.95", "0.74", "1470"});
  std::vector<Row> rows;
  for (const char* world : {"room", "building", "office"})
    for (const double noise : {0.005, 0.01, 0.02, 0.03}) rows.push_back({world, Sick(noise)});
  for (const auto& [beams, degrees] : {std::pair{361, 180.0}, std::pair{1081, 270.0}}) {
    rows.push_back({"building", Sick(0.01)});
    rows.back().laser.beams = beams;
    rows.back().laser.field_of_view_rad = Radians(degrees);
  }
  Plot plot{.title = "Line extraction against range noise, 181 beams (dashed: Table 2.1)",
            .x = {"standard deviation of a range", "cm"},
            .y = {"rate", "%", false, 0.0, 101.0}};
  Plot spread{.title = "Spread of line parameters against range noise (dashed: Table 2.1)",
              .x = {"standard deviation of a range", "cm"},
              .y = {"sigma", "cm or deg", false, 0.0, {}}};
  plot.bounds = {{86.0, "thesis: true positives"}, {8.9, "thesis: false positives"}};
  spread.bounds = {{1.95, "thesis: sigma r (cm)"}, {0.74, "thesis: sigma alpha (deg)"}};
  bool plausible = true, worse = false;
  for (const Row& row : rows) {
    const Scene scene(row.world);
    sim::Random random(context.seed);
    Quality quality;
    for (int i = 0; i < context.Pick(400, 60); ++i)
      AddMeasured(scene, scene.DrawPose(random), row.laser, random, quality);
    table.Add({"simulated", row.world, Count(row.laser.beams), Number(100 * row.laser.error.sigma_m, 1),
               Number(100.0 * quality.extracted / quality.scans, 0), Percent(quality.true_positive()),
               Percent(quality.false_positive()), Number(quality.sigma_r_cm(), 2), Number(quality.sigma_alpha_deg(), 2),
               Number(1e3 * quality.scans / quality.cpu_ms, 0)});
    if (row.laser.beams == 181) {
      const auto add = [&](Plot& to, const std::string& label, double y) {
        auto it = std::find_if(to.series.begin(), to.series.end(), [&](const Series& s) { return s.label == label; });
        if (it == to.series.end()) it = to.series.insert(it, Series{.label = label});
        it->x.push_back(100 * row.laser.error.sigma_m), it->y.push_back(y);
      };
      add(plot, row.world + ": true positives", 100 * quality.true_positive());
      add(plot, row.world + ": false positives", 100 * quality.false_positive());
      add(spread, row.world + ": sigma r (cm)", quality.sigma_r_cm());
      add(spread, row.world + ": sigma alpha (deg)", quality.sigma_alpha_deg());
    }
    if (row.laser.error.sigma_m > 0.011) continue;
    plausible = plausible && quality.true_positive() > 0.75 && quality.false_positive() < 0.2;
    const bool this_worse = quality.true_positive() < 0.86 || quality.false_positive() > 0.089 ||
                            quality.sigma_r_cm() > 1.95 || quality.sigma_alpha_deg() > 0.74;
    if (this_worse)
      report.Warn("at least one figure is worse than in the row of the thesis: " + row.world + ", " +
                  Count(row.laser.beams) + " beams, sigma " + Number(100 * row.laser.error.sigma_m, 1) + " cm");
    worse = worse || this_worse;
  }
  report.Add(table, "table_2_1");
  report.Add(plot, "line_rates");
  report.Add(spread, "line_spread");
  if (!worse)
    report.Text("All figures are better than in the row of the thesis if the ranges have a noise of at most 1 cm.");
  report.Expect(plausible,
                "with a noise of 1 cm, fewer than 75 % of the walls are found or more than 20 % of the lines are "
                "wrong: the line extraction or this study must be broken");
}

}  // namespace cairn::studies
