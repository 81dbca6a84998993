// The joint occupancy map of a site: per chunk the grids of all its sessions, summed as log odds into the cells of one
// tile (independent evidence adds), and the pyramid above. Robots share the map frame through their start poses.
// Not a publisher: Render says which tiles' cells changed, and nothing here knows epochs, versions or encodings.
// Invariant: after Render, cells() equals what a map built from scratch from the same chunks would hold.
// Not thread-safe: belongs to the site's strand.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <vector>

#include "common/map/tile.h"
#include "server/robots/robot_event.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

class JointMap {
 public:
  using Cells = std::shared_ptr<const TileCells>;

  // One session's chunks that changed (null: gone).
  void Apply(const GridChange& change);
  // One session's whole grid is now this.
  void Replace(SessionId session, const slam::OccupancyGrid::Chunks& chunks);
  [[nodiscard]] slam::OccupancyGrid::Chunks ChunksOf(SessionId session) const;

  // Brings cells() up to date; returns the tiles of all levels whose cells changed, appeared or vanished.
  std::vector<TileKey> Render();
  [[nodiscard]] const std::map<TileKey, Cells>& cells() const { return cells_; }
  [[nodiscard]] bool dirty() const { return !dirty_.empty(); }

 private:
  using Layers = std::map<SessionId, std::shared_ptr<const slam::GridChunk>>;

  void SetLayer(slam::ChunkKey key, SessionId session, std::shared_ptr<const slam::GridChunk> chunk);
  // Stores the cells if they differ; true where they do. Null means unknown throughout.
  bool Store(TileKey key, Cells cells);
  Cells Sum(slam::ChunkKey key) const;
  Cells Reduce(TileKey parent) const;

  std::map<slam::ChunkKey, Layers> chunks_;
  std::set<slam::ChunkKey> dirty_;
  std::map<TileKey, Cells> cells_;
};

}  // namespace cairn::server
