// An unbounded occupancy grid in the map frame, in square chunks that copies share until one of them writes.
// Chunk (0,0) has its lower-left corner at the map origin; chunks coincide with the published tiles of level 0.
// Not thread-safe for writing; a chunk handed out is immutable and may be read anywhere.
// Source: thesis A 3.7 (deterministic and probabilistic cells); log odds after Moravec and Elfes 1985.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/map/tile.h"
#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/grid/scan_raster.h"

namespace cairn::slam {

// Log odds in units of 0.01, clamped; kUnseen where no ray has passed.
inline constexpr std::int16_t kUnseen = INT16_MIN;
struct GridChunk {
  std::array<std::int16_t, kTileArea> log_odds;
};

struct ChunkKey {
  int x = 0;
  int y = 0;
  auto operator<=>(const ChunkKey&) const = default;
};

// 0..100, or kUnknownCell.
[[nodiscard]] std::uint8_t OccupancyOf(std::int16_t log_odds);

enum class GridModel : std::uint8_t { kProbabilistic = 0, kDeterministic };

struct GridOptions {
  GridModel model = GridModel::kProbabilistic;
  double resolution_m = 0.05;
  double hit_probability = 0.70;    // Nearer 1: one hit makes a wall.
  double miss_probability = 0.42;   // Nearer 0: one ray through clears it.
  double clamp_probability = 0.98;  // Nearer 1: more contrary evidence needed to change a cell's mind.
  double max_ray_m = 25.0;          // Rays are cut here; what is hit farther away is not drawn.
  double no_return_free_m = 0.0;    // How far a beam that hit nothing clears.
};
void Visit(OptionVisitor& visitor, GridOptions& options);

class OccupancyGrid {
 public:
  using Chunks = std::map<ChunkKey, std::shared_ptr<const GridChunk>>;

  explicit OccupancyGrid(const GridOptions& options);
  // Goes on from chunks that another grid with the same options has published.
  OccupancyGrid(const GridOptions& options, Chunks published);
  OccupancyGrid(OccupancyGrid&&) = default;
  OccupancyGrid& operator=(OccupancyGrid&&) = default;

  // A copy that shares every chunk with this grid; each writes its own from now on.
  [[nodiscard]] OccupancyGrid Share();

  // Draws one scan taken at this pose. Validated scans and finite poses only.
  void Draw(const Scan& scan, const Pose2& T_map_robot);

  // Every chunk as it is now; what is handed out never changes any more.
  [[nodiscard]] const Chunks& Publish();
  // Chunks written since the last call, in key order; also publishes.
  [[nodiscard]] std::vector<ChunkKey> TakeDirty();
  [[nodiscard]] const Chunks& chunks() const { return chunks_; }
  void MarkAllDirty();
  // Also a chunk this grid does not have: whoever mirrors the grid has to forget it.
  void MarkDirty(const ChunkKey& key) { dirty_.insert(key); }
  // 0..100 or kUnknownCell at a point.
  [[nodiscard]] std::uint8_t OccupancyAt(const Eigen::Vector2d& p_map) const;
  [[nodiscard]] const GridOptions& options() const { return options_; }

 private:
  GridChunk& Writable(const ChunkKey& key);

  GridOptions options_;
  std::int16_t hit_ = 0, miss_ = 0, clamp_ = 0;
  Chunks chunks_;
  std::set<ChunkKey> dirty_;
  std::set<ChunkKey> owned_;  // Chunks nobody else has seen: written in place.
  ScanRaster raster_;
};

}  // namespace cairn::slam
