// An unbounded occupancy grid in the map frame. It consists of square chunks. A chunk that was handed out is
// shared, and the grid copies it before it next writes to it. Chunk (0,0) has its lower-left corner at the
// map origin; chunks coincide with the published tiles of level 0.
// Not thread-safe; a chunk that was handed out is immutable and may be read from any thread.
// Source: thesis A 3.7 (deterministic and probabilistic cells); log odds after Moravec and Elfes 1985.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/map/tile.h"
#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/grid/cell_mask.h"
#include "server/slam/grid/scan_raster.h"

namespace cairn::slam {

// A cell holds log odds in units of 0.01, clamped, or kUnseen if no ray has passed it.
inline constexpr std::int16_t kUnseen = INT16_MIN;
struct GridChunk {
  std::array<std::int16_t, kTileArea> log_odds;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.log_odds);
  }
};

struct ChunkKey {
  int x = 0;
  int y = 0;
  auto operator<=>(const ChunkKey&) const = default;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.x, self.y);
    constexpr int kMost = 1 << 22;
    archive.Require(-kMost < self.x && self.x < kMost && -kMost < self.y && self.y < kMost, "the place of a chunk");
  }
};

[[nodiscard]] inline ChunkKey ChunkOf(const GridCell& cell) {
  return {FloorDiv(cell.x, kTileCells), FloorDiv(cell.y, kTileCells)};
}
// The index of a cell in the chunk `key`, which contains it.
[[nodiscard]] inline std::size_t IndexInChunk(const GridCell& cell, const ChunkKey& key) {
  return static_cast<std::size_t>((cell.y - key.y * kTileCells) * kTileCells + (cell.x - key.x * kTileCells));
}

// The log odds of a probability between 0 and 1.
[[nodiscard]] std::int16_t LogOddsOf(double probability);
// Converts log odds to an occupancy of 0..100 %, or kUnseen to kUnknownCell.
[[nodiscard]] std::uint8_t OccupancyOf(std::int16_t log_odds);
// The same of all cells of a chunk.
[[nodiscard]] TileCells OccupanciesOf(const GridChunk& chunk);

// How a scan changes a cell. Thesis A 3.7 describes two ways: it first spread each hit by a triangular
// density in the plane (kTriangular), found that walls became thick, and then used deterministic cells that,
// once occupied, become free again only slowly (kDegrading). kProbabilistic, the default, and kDeterministic
// are our own. `cairn-study thesis-a --only grid` prints, in the order of the values below: walls found 88.7,
// 84.5, 99.7, 99.7 %; thickness of a wall 0.10, 0.08, 0.24, 0.10 m; occupied cells that people left where
// there is no wall 0.0, 1.4, 0.0, 2.0 %.
enum class GridModel : std::uint8_t {
  kProbabilistic = 0,  // Hits and misses add up as log odds.
  kDeterministic,      // The last scan decides.
  kTriangular,         // As kProbabilistic, but a hit spreads over the cells nearer than `hit_spread_m`.
  // A hit makes a cell occupied at once. A ray through a cell that is not occupied makes it free at once; an
  // occupied cell loses a step of `miss_probability` with each ray, until it is free.
  kDegrading,
};

struct GridOptions {
  GridModel model = GridModel::kProbabilistic;
  double resolution_m = 0.05;
  double hit_probability = 0.70;
  double miss_probability = 0.42;
  double clamp_probability = 0.98;
  double max_ray_m = 25.0;
  double no_return_free_m = 0.0;
  double hit_spread_m = 0.15;  // The thesis prints no value.

  bool operator==(const GridOptions&) const = default;
};
void Visit(OptionVisitor& visitor, GridOptions& options);

class OccupancyGrid {
 public:
  using SharedChunk = std::shared_ptr<const GridChunk>;
  using Chunks = std::map<ChunkKey, SharedChunk>;
  // The chunks that changed, as they are now; null if the grid no longer has the chunk.
  using Change = std::vector<std::pair<ChunkKey, SharedChunk>>;
  // The cells that scans have passed or hit, by chunk.
  using Looks = std::map<ChunkKey, CellMask>;

  explicit OccupancyGrid(const GridOptions& options);
  // Starts with the chunks that another grid with the same options has shared.
  OccupancyGrid(const GridOptions& options, const Chunks& shared);
  OccupancyGrid(OccupancyGrid&&) = default;
  OccupancyGrid& operator=(OccupancyGrid&&) = default;

  using Wants = std::function<bool(const ChunkKey& key)>;
  // Draws one scan taken at this pose. `wants`, if given, is asked once about every chunk in which the scan changes
  // cells, and only those chunks change for which it says yes. `looks`, if given, gets the cells that the scan touches
  // there in addition: one that holds the largest log odds already is looked at without a change. REQUIRES: the scan
  // passed ValidateScan, and the pose is finite.
  void Draw(const Scan& scan, const Pose2& T_map_robot, const Wants& wants = {}, Looks* looks = nullptr);
  // Replaces all chunks by those of another grid with the same options. All chunks of both grids count as
  // changed.
  void ReplaceBy(OccupancyGrid&& other);

  // All chunks as they are now. A chunk that was handed out never changes: where this grid writes again, it
  // continues with a copy.
  [[nodiscard]] Chunks Share();
  // The chunks that changed since the last call, in key order. They never change either.
  [[nodiscard]] Change TakeChange();

  // Calls visit(key, chunk) for every chunk, in key order.
  template <typename Visit>
  void ForEachChunk(const Visit& visit) const {
    for (const auto& [key, slot] : slots_) visit(key, slot.chunk());
  }
  [[nodiscard]] std::size_t chunk_count() const { return slots_.size(); }
  // Null: no ray has come near. Valid until the grid is changed or handed out.
  [[nodiscard]] const GridChunk* chunk(const ChunkKey& key) const;
  // Occupancy at a point: 0..100 %, or kUnknownCell.
  [[nodiscard]] std::uint8_t OccupancyAt(const Eigen::Vector2d& p_map) const;
  [[nodiscard]] const GridOptions& options() const { return options_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    std::uint64_t chunks = self.slots_.size();
    archive(chunks, self.changed_);
    if constexpr (Archive::kReads) {
      self.slots_.clear();
      for (ChunkKey key; archive.ok() && self.slots_.size() < chunks;) {
        SharedChunk chunk;
        archive(key, chunk);
        archive.Require(self.slots_.emplace(key, Slot{nullptr, std::move(chunk)}).second, "the chunks of the map");
      }
    } else {
      for (const auto& [key, slot] : self.slots_)
        archive(key, slot.own ? std::make_shared<const GridChunk>(*slot.own) : slot.shared);
    }
  }

 private:
  // Either a chunk that only this grid uses and may write to, or one that others may read.
  struct Slot {
    std::unique_ptr<GridChunk> own;
    SharedChunk shared;  // Set if `own` is null.

    [[nodiscard]] const GridChunk& chunk() const { return own ? *own : *shared; }
    const SharedChunk& Share() {
      if (own) shared = std::move(own);
      return shared;
    }
  };
  GridChunk& Writable(const ChunkKey& key);
  // The value of a cell after one more scan. `hit` is the share of a hit that ScanRaster reports.
  [[nodiscard]] std::int16_t After(std::int16_t before, double hit) const;
  void AddUp(const ScanRaster::Piece& marks, std::int16_t* cells) const;

  GridOptions options_;
  std::int16_t hit_ = 0, miss_ = 0, clamp_ = 0;
  bool adds_up_ = true;  // Whether a cell adds whole hits and misses, and nothing else.
  std::map<ChunkKey, Slot> slots_;
  std::set<ChunkKey> changed_;
  ScanRaster raster_;
};

}  // namespace cairn::slam
