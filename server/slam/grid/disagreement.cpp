#include "server/slam/grid/disagreement.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "common/geometry/transform2.h"

namespace cairn::slam {
namespace {

constexpr std::uint8_t kOccupiedFrom = 50;  // Percent; a cell above this counts as occupied.

static_assert(kTileCells % kBlockCells == 0);  // A block lies in one chunk.

// Cells with log odds of 0 and less are at 50 % and below, or unseen.
bool IsOccupied(const GridChunk* chunk, std::size_t cell) {
  return chunk != nullptr && chunk->log_odds[cell] > 0 && OccupancyOf(chunk->log_odds[cell]) > kOccupiedFrom;
}

}  // namespace

ScanComparison::ScanComparison(const OccupancyGrid& grid)
    : grid_(grid),
      rings_(static_cast<int>(std::ceil(Disagreement::kMaxDistanceM / grid.options().resolution_m))),
      chunk_(grid.chunk(key_)) {
  const double cell_m = grid.options().resolution_m;
  for (int y = -rings_; y <= rings_; ++y) {
    for (int x = -rings_; x <= rings_; ++x) {
      const double squared_m2 = (x * x + y * y) * cell_m * cell_m;
      if (squared_m2 < Disagreement::kMaxDistanceM * Disagreement::kMaxDistanceM)
        offsets_.push_back({x, y, squared_m2});
    }
  }
  std::ranges::stable_sort(offsets_, {}, &Offset::squared_m2);
}

bool ScanComparison::Occupied(const GridCell& cell) {
  const ChunkKey key = ChunkOf(cell);
  if (key != key_) {
    key_ = key;
    chunk_ = grid_.chunk(key);
  }
  return IsOccupied(chunk_, IndexInChunk(cell, key));
}

// Calls looks_around(cell) for the cell at the end of every beam that is compared.
template <typename Visit>
Disagreement ScanComparison::CompareEach(const Scan& scan, const Pose2& T_map_robot, const Visit& looks_around) {
  Disagreement sum;
  const GridOptions& options = grid_.options();
  const Transform2 to_map(T_map_robot * scan.T_robot_laser);
  const std::span<const Eigen::Vector2d> directions = directions_.Of(scan);
  const double cos_tilt = std::cos(scan.tilt_rad);
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    const float range_m = scan.ranges_m[beam];
    if (ClassifyRange(range_m, scan.range_min_m, scan.range_max_m) != BeamClass::kHit) continue;
    if (range_m > options.max_ray_m) continue;  // Farther hits were not drawn into the grid.
    const GridCell at = CellOf(to_map * OnGround(range_m, directions[beam], cos_tilt), options.resolution_m);
    looks_around(at);
    const auto nearest = std::ranges::find_if(offsets_, [&](const Offset& offset) {
      return Occupied({at.x + offset.x, at.y + offset.y});
    });
    sum.sum_m2_ +=
        nearest == offsets_.end() ? Disagreement::kMaxDistanceM * Disagreement::kMaxDistanceM : nearest->squared_m2;
    ++sum.beams_;
  }
  return sum;
}

Disagreement ScanComparison::Compare(const Scan& scan, const Pose2& T_map_robot) {
  return CompareEach(scan, T_map_robot, [](const GridCell&) {});
}

Disagreement ScanComparison::Compare(const Scan& scan, const Pose2& T_map_robot, std::vector<ChunkKey>& blocks) {
  blocks.clear();
  ChunkKey low_before, high_before;
  Disagreement sum = CompareEach(scan, T_map_robot, [&](const GridCell& at) {
    const ChunkKey low{FloorDiv(at.x - rings_, kBlockCells), FloorDiv(at.y - rings_, kBlockCells)};
    const ChunkKey high{FloorDiv(at.x + rings_, kBlockCells), FloorDiv(at.y + rings_, kBlockCells)};
    if (!blocks.empty() && low == low_before && high == high_before) return;  // As those of the beam before, mostly.
    low_before = low;
    high_before = high;
    for (int y = low.y; y <= high.y; ++y)
      for (int x = low.x; x <= high.x; ++x) blocks.push_back({x, y});
  });
  std::ranges::sort(blocks);
  const auto twice = std::unique(blocks.begin(), blocks.end());
  blocks.erase(twice, blocks.end());
  return sum;
}

void Disagreement::Add(const Scan& scan, const Pose2& T_map_robot, const OccupancyGrid& grid) {
  Add(ScanComparison(grid).Compare(scan, T_map_robot));
}

void Disagreement::Add(const Disagreement& other) {
  sum_m2_ += other.sum_m2_;
  beams_ += other.beams_;
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
