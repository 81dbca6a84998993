// The disagreement of scans with a map: the mean, over all beams with an echo, of the squared distance from
// the end of the beam, at the given pose, to the nearest occupied cell of the grid, in m^2. A distance counts
// at most as kMaxDistanceM, so that people and opened doors do not dominate the mean. Smoothing compares
// paths by it. A plain value; Add joins the sums of several.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::slam {

class Disagreement {
 public:
  static constexpr double kMaxDistanceM = 0.3;

  void Add(const Scan& scan, const Pose2& T_map_robot, const OccupancyGrid& grid);
  void Add(const Disagreement& other);
  [[nodiscard]] double mean_m2() const { return beams_ > 0 ? sum_m2_ / static_cast<double>(beams_) : 0.0; }

 private:
  double sum_m2_ = 0.0;
  std::int64_t beams_ = 0;
};

// What Disagreement::Add looks at: squares of kBlockCells x kBlockCells cells. A block is named as chunks are; block
// (0, 0) has its lower-left corner at the map origin.
inline constexpr int kBlockCells = 16;

// The blocks in which Add looks for occupied cells, and maybe a few next to them.
[[nodiscard]] std::set<ChunkKey> BlocksComparedWith(const Scan& scan, const Pose2& T_map_robot,
                                                    const GridOptions& options);
// Adds the blocks of a chunk in which Add would not find the same cells occupied. Null: there is no such chunk.
void AddChangedBlocks(const ChunkKey& key, const GridChunk* before, const GridChunk* after, std::set<ChunkKey>& blocks);

}  // namespace cairn::slam
