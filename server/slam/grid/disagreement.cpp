#include "server/slam/grid/disagreement.h"

#include <algorithm>
#include <cmath>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

constexpr std::uint8_t kOccupiedFrom = 50;  // Percent; a cell above this counts as occupied.

static_assert(kTileCells % kBlockCells == 0);  // A block lies in one chunk.

// Cells with log odds of 0 and less are at 50 % and below, or unseen.
bool IsOccupied(const GridChunk* chunk, std::size_t cell) {
  return chunk != nullptr && chunk->log_odds[cell] > 0 && OccupancyOf(chunk->log_odds[cell]) > kOccupiedFrom;
}

// How far the search for the nearest occupied cell goes, in cells.
int RingsOf(double max_distance_m, double cell_m) {
  return static_cast<int>(std::ceil(max_distance_m / cell_m));
}

// Calls visit(p_map) for the end of every beam that is compared.
template <typename Visit>
void ForEachEnd(const Scan& scan, const Pose2& T_map_robot, const GridOptions& options, const Visit& visit) {
  const Pose2 T_map_laser = T_map_robot * scan.T_robot_laser;
  const double reach_m = options.max_ray_m;  // Hits farther away were not drawn into the grid.
  const double cos_tilt = std::cos(scan.tilt_rad);
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const float range_m = scan.ranges_m[i];
    if (ClassifyRange(range_m, scan.range_min_m, scan.range_max_m) != BeamClass::kHit || range_m > reach_m) continue;
    const double bearing = scan.angle_first_rad + static_cast<double>(i) * scan.angle_step_rad;
    const Eigen::Vector2d p_laser = OnGround(range_m, bearing, cos_tilt);
    visit(Eigen::Vector2d(T_map_laser * p_laser));
  }
}

// Cells of a grid that are read one near the other: the chunk of the last one is not looked up again.
class NearbyCells {
 public:
  explicit NearbyCells(const OccupancyGrid& grid) : grid_(grid), chunk_(grid.chunk(key_)) {}

  [[nodiscard]] bool Occupied(const GridCell& cell) {
    const ChunkKey key = ChunkOf(cell);
    if (key != key_) {
      key_ = key;
      chunk_ = grid_.chunk(key);
    }
    return IsOccupied(chunk_, IndexInChunk(cell, key));
  }

 private:
  const OccupancyGrid& grid_;
  ChunkKey key_;
  const GridChunk* chunk_;
};

struct Offset {
  int x = 0;
  int y = 0;
  double squared_m2 = 0.0;
};

// To all cells nearer than `max_distance_m`, the nearest first.
std::vector<Offset> OffsetsByDistance(double max_distance_m, double cell_m) {
  const int rings = RingsOf(max_distance_m, cell_m);
  std::vector<Offset> offsets;
  for (int y = -rings; y <= rings; ++y) {
    for (int x = -rings; x <= rings; ++x) {
      const double squared_m2 = (x * x + y * y) * cell_m * cell_m;
      if (squared_m2 < max_distance_m * max_distance_m) offsets.push_back({x, y, squared_m2});
    }
  }
  std::ranges::stable_sort(offsets, {}, &Offset::squared_m2);
  return offsets;
}

}  // namespace

void Disagreement::Add(const Scan& scan, const Pose2& T_map_robot, const OccupancyGrid& grid) {
  const std::vector<Offset> offsets = OffsetsByDistance(kMaxDistanceM, grid.options().resolution_m);
  NearbyCells cells(grid);
  ForEachEnd(scan, T_map_robot, grid.options(), [&](const Eigen::Vector2d& p_map) {
    const GridCell at = CellOf(p_map, grid.options().resolution_m);
    const auto nearest = std::ranges::find_if(offsets, [&](const Offset& offset) {
      return cells.Occupied({at.x + offset.x, at.y + offset.y});
    });
    sum_m2_ += nearest == offsets.end() ? kMaxDistanceM * kMaxDistanceM : nearest->squared_m2;
    ++beams_;
  });
}

void Disagreement::Add(const Disagreement& other) {
  sum_m2_ += other.sum_m2_;
  beams_ += other.beams_;
}

std::set<ChunkKey> BlocksComparedWith(const Scan& scan, const Pose2& T_map_robot, const GridOptions& options) {
  std::set<ChunkKey> blocks;
  const double block_m = kBlockCells * options.resolution_m;
  // One cell more than is searched, for what rounding may do.
  const double margin_m = (1 + RingsOf(Disagreement::kMaxDistanceM, options.resolution_m)) * options.resolution_m;
  const auto block_at = [block_m](double coordinate_m) {
    constexpr double kFarthest = 1e8;  // A pose may have any finite coordinates.
    return static_cast<int>(std::clamp(std::floor(coordinate_m / block_m), -kFarthest, kFarthest));
  };
  ChunkKey low_before, high_before;
  ForEachEnd(scan, T_map_robot, options, [&](const Eigen::Vector2d& p_map) {
    const ChunkKey low{block_at(p_map.x() - margin_m), block_at(p_map.y() - margin_m)};
    const ChunkKey high{block_at(p_map.x() + margin_m), block_at(p_map.y() + margin_m)};
    if (!blocks.empty() && low == low_before && high == high_before) return;  // As those of the beam before, mostly.
    low_before = low;
    high_before = high;
    for (int y = low.y; y <= high.y; ++y)
      for (int x = low.x; x <= high.x; ++x) blocks.insert({x, y});
  });
  return blocks;
}

void AddChangedBlocks(const ChunkKey& key, const GridChunk* before, const GridChunk* after,
                      std::set<ChunkKey>& blocks) {
  constexpr int kBlocks = kTileCells / kBlockCells;
  for (std::size_t cell = 0; cell < kTileArea; ++cell) {
    if (IsOccupied(before, cell) == IsOccupied(after, cell)) continue;
    const int x = static_cast<int>(cell) % kTileCells, y = static_cast<int>(cell) / kTileCells;
    blocks.insert({key.x * kBlocks + x / kBlockCells, key.y * kBlocks + y / kBlockCells});
  }
}

}  // namespace cairn::slam
