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
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

class Disagreement {
 public:
  static constexpr double kMaxDistanceM = 0.3;

  // Of many scans with one grid: ScanComparison.
  void Add(const Scan& scan, const Pose2& T_map_robot, const OccupancyGrid& grid);
  void Add(const Disagreement& other);
  [[nodiscard]] double mean_m2() const { return beams_ > 0 ? sum_m2_ / static_cast<double>(beams_) : 0.0; }

 private:
  friend class ScanComparison;
  double sum_m2_ = 0.0;
  std::int64_t beams_ = 0;
};

// What a comparison looks at: squares of kBlockCells x kBlockCells cells. A block is named as chunks are; block
// (0, 0) has its lower-left corner at the map origin.
inline constexpr int kBlockCells = 16;

// Compares many scans with one grid. Not thread-safe.
class ScanComparison {
 public:
  // `grid` must outlive the comparison, and not change meanwhile.
  explicit ScanComparison(const OccupancyGrid& grid);

  [[nodiscard]] Disagreement Compare(const Scan& scan, const Pose2& T_map_robot);
  // The same. `blocks`: those in which it looks for occupied cells, in order, each once.
  [[nodiscard]] Disagreement Compare(const Scan& scan, const Pose2& T_map_robot, std::vector<ChunkKey>& blocks);

 private:
  struct Offset {
    int x = 0;
    int y = 0;
    double squared_m2 = 0.0;
  };
  template <typename Visit>
  Disagreement CompareEach(const Scan& scan, const Pose2& T_map_robot, const Visit& looks_around);
  [[nodiscard]] bool Occupied(const GridCell& cell);

  const OccupancyGrid& grid_;
  int rings_;                    // How far it looks, in cells.
  std::vector<Offset> offsets_;  // To the cells at which it looks, the nearest first.
  BeamDirections directions_;
  // Cells that are read one after the other are near each other.
  ChunkKey key_;
  const GridChunk* chunk_;  // At key_; null: there is none.
};

// Adds the blocks of a chunk in which a comparison would not find the same cells occupied. Null: there is no such
// chunk.
void AddChangedBlocks(const ChunkKey& key, const GridChunk* before, const GridChunk* after, std::set<ChunkKey>& blocks);

}  // namespace cairn::slam
