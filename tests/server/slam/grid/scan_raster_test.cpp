#include "server/slam/grid/scan_raster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <random>
#include <utility>

#include "server/slam/scan/beam_points.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using Cells = std::map<std::pair<int, int>, int>;  // The mark of each touched cell.

// The plain form: every ray by itself, cell by cell, as Bresenham 1965 for all octants alike.
class PlainRaster {
 public:
  static Cells Of(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options) {
    PlainRaster raster;
    const Pose2 T_map_laser = T_map_robot * scan.T_robot_laser;
    const auto cell = [&](const Eigen::Vector2d& p) {
      return GridCell{static_cast<int>(std::floor(p.x() / options.resolution_m)),
                      static_cast<int>(std::floor(p.y() / options.resolution_m))};
    };
    const GridCell from = cell(T_map_laser.translation());
    for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
      const BeamClass kind = ClassifyRange(scan.ranges_m[beam], scan.range_min_m, scan.range_max_m);
      if (kind == BeamClass::kInvalid) continue;
      const double seen = kind == BeamClass::kHit ? static_cast<double>(scan.ranges_m[beam])
                                                  : std::min(options.no_return_free_m, scan.range_max_m);
      const bool hit = kind == BeamClass::kHit && seen <= options.max_ray_m;
      const double range = std::min(seen, options.max_ray_m);
      if (range <= 0.0) continue;
      const double bearing = scan.angle_first_rad + static_cast<double>(beam) * scan.angle_step_rad;
      const GridCell to = cell(T_map_laser * OnGround(range, bearing, std::cos(scan.tilt_rad)));
      raster.Ray(from, to, hit);
      if (hit && options.hit_spread_m > 0.0) raster.Spread(to, options.hit_spread_m / options.resolution_m);
    }
    return raster.cells_;
  }

 private:
  void Mark(int x, int y, int mark) {
    int& held = cells_[{x, y}];
    held = std::max(held, mark);
  }
  void Ray(GridCell from, GridCell to, bool hit) {
    const int dx = std::abs(to.x - from.x), dy = -std::abs(to.y - from.y);
    int error = dx + dy, x = from.x, y = from.y;
    while (x != to.x || y != to.y) {
      Mark(x, y, ScanRaster::kPassed);
      const int twice = 2 * error;
      if (twice >= dy) error += dy, x += from.x < to.x ? 1 : -1;
      if (twice <= dx) error += dx, y += from.y < to.y ? 1 : -1;
    }
    Mark(to.x, to.y, hit ? ScanRaster::kHit : ScanRaster::kPassed);
  }
  void Spread(GridCell hit, double spread) {
    const int reach = static_cast<int>(std::ceil(spread));
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const double share = 1.0 - std::sqrt(static_cast<double>(dx * dx + dy * dy)) / spread;
        if (share > 0.0) Mark(hit.x + dx, hit.y + dy, static_cast<int>(1 + share * 254));
      }
    }
  }

  Cells cells_;
};

TEST(ScanRaster, MarksWhatEveryRayByItselfMarks) {
  std::mt19937_64 rng(11);
  std::uniform_real_distribution<double> place(-30.0, 30.0), turn(-kPi, kPi);
  std::uniform_real_distribution<float> range(-1.0F, 40.0F);
  ScanRaster raster;  // One for all, because it keeps its memory.
  std::size_t cells = 0;
  for (int run = 0; run < 60; ++run) {
    Scan scan = test::Look(test::Office(), {}, test::FullTurnLaser(90 + run));
    for (std::size_t beam = 0; beam < scan.ranges_m.size() && run % 2 == 0; ++beam) scan.ranges_m[beam] = range(rng);
    scan.T_robot_laser = {0.3, -0.1, 0.2};
    const Pose2 T_map_robot{place(rng), place(rng), turn(rng)};
    const RasterOptions options{.resolution_m = run % 3 == 0 ? 0.2 : 0.05,
                                .max_ray_m = run % 4 == 0 ? 12.0 : 25.0,
                                .no_return_free_m = run % 5 == 0 ? 3.0 : 0.0,
                                .hit_spread_m = run % 7 == 0 ? 0.15 : 0.0};
    Cells found;
    raster.Rasterise(scan, T_map_robot, options, [&](GridCell first, const ScanRaster::Piece& marks) {
      for (int i = 0; i < ScanRaster::kPiece; ++i) {
        const int mark = marks[static_cast<std::size_t>(i)];
        if (mark == ScanRaster::kUntouched) continue;
        const auto [at, fresh] = found.emplace(std::pair{first.x + i, first.y}, mark);
        EXPECT_TRUE(fresh) << "a cell is visited once";
      }
    });
    ASSERT_EQ(found, PlainRaster::Of(scan, T_map_robot, options)) << run;
    cells += found.size();
  }
  EXPECT_GT(cells, 100'000U);
}

TEST(ScanRaster, ABeamThatEndsWhereAnotherHitDoesNotClearIt) {
  Scan scan = test::Look(test::Office(), {}, test::FullTurnLaser(90));
  scan.ranges_m = {3.0F, static_cast<float>(scan.range_max_m)};  // The second one has no echo.
  scan.angle_first_rad = 0.01;
  scan.angle_step_rad = 1e-4;
  const RasterOptions options{.no_return_free_m = 3.0};
  int hits = 0;
  ScanRaster().Rasterise(scan, {}, options, [&](GridCell, const ScanRaster::Piece& marks) {
    hits += static_cast<int>(std::count(marks.begin(), marks.end(), ScanRaster::kHit));
  });
  EXPECT_EQ(hits, 1);
}

// A pose may have any finite coordinates.
TEST(ScanRaster, FarAwayAllRaysFallIntoOneCell) {
  const Scan scan = test::Look(test::Office(), {}, test::FullTurnLaser(90));
  int pieces = 0;
  ScanRaster().Rasterise(scan, {1e300, -1e300, 1.0}, {}, [&](GridCell, const ScanRaster::Piece&) { ++pieces; });
  EXPECT_EQ(pieces, 1);
}

}  // namespace
}  // namespace cairn::slam
