// The joint occupancy map of a site, and its pyramid of coarser levels. For each chunk, the grids of all sessions are
// summed into the cells of one tile, with less weight for those of sessions that have ended, and for what others have
// looked at later (layer_sum.h). The start poses place the robots in one map frame. This class does not publish: Render
// returns the tiles whose cells changed; epochs, versions and encodings are handled by Site. Invariant: after Render,
// cells() equals a map that is built from scratch from the same chunks and edits, with the same sessions hidden and
// ended, and the same looks. Not thread-safe: used on the site's strand only.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "common/map/tile.h"
#include "server/maps/last_looks.h"
#include "server/maps/map_edits.h"
#include "server/maps/memory_count.h"
#include "server/maps/robot_grid.h"
#include "server/maps/tile_pyramid.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

class JointMap {
 public:
  using Cells = TilePyramid::Cells;

  // `past_probability`: the largest probability that earlier evidence gives a cell that a session has seen later.
  explicit JointMap(double past_probability);

  // Applies the changed chunks of one session (null: removed). It has looked at the cells of the change later than all
  // others. Who was the last is noted where at least two sessions have drawn, and is not stored: after a restart
  // sessions that go on add up until they look again.
  void Apply(const GridChange& change);
  // Replaces the whole grid of one session, as after its map was corrected. Where it still says the same of a cell that
  // it has looked at last, it is still the last.
  void Replace(SessionId session, const slam::OccupancyGrid::Chunks& chunks);
  [[nodiscard]] slam::OccupancyGrid::Chunks ChunksOf(SessionId session) const;
  // The grids of hidden sessions are kept, but are not part of the sum. A session is shown unless it was hidden.
  void SetHidden(SessionId session, bool hidden);
  [[nodiscard]] const std::set<SessionId>& hidden() const { return hidden_; }

  // The session has ended, later than those for which this was called before. A second call does nothing. Until then a
  // session counts as one of today.
  void SetPast(SessionId session);
  // Those that have ended, in that order.
  [[nodiscard]] std::vector<SessionId> past() const;

  // Two grids of the past as one, as they count in the sum.
  [[nodiscard]] slam::OccupancyGrid::Chunks SumOfPast(const slam::OccupancyGrid::Chunks& older,
                                                      const slam::OccupancyGrid::Chunks& later) const;
  // Makes one layer of those of two sessions, which gets the number of the later one. What the map shows stays the same
  // if no other session that is shown has ended between the two. REQUIRES: both have ended, in this order, and are
  // shown.
  void MergePast(SessionId older, SessionId later);
  // Forgets the session with all that it has drawn.
  void Remove(SessionId session);

  // Wherever the session has drawn, another one that is shown has drawn as well.
  [[nodiscard]] bool IsCovered(SessionId session) const;

  // The sum of the grids of the sessions before this one that are shown, in and around the area of its own grid.
  [[nodiscard]] slam::OccupancyGrid::Chunks DrawnBefore(SessionId session) const;

  // What people have said about the map, in place of what they had said before. It covers the cells, and is not part of
  // the grids of sessions.
  void SetEdits(EditOverlay overlay);
  // Whether a session that is shown has drawn anything.
  [[nodiscard]] bool drawn() const;
  // The sessions that are shown and have drawn in this tile of level 0.
  [[nodiscard]] std::vector<SessionId> DrawnBy(slam::ChunkKey key) const;
  // The smallest and the largest place of a tile of level 0 in which they have; nothing where drawn() is false.
  [[nodiscard]] std::optional<std::pair<slam::ChunkKey, slam::ChunkKey>> DrawnBox() const;

  // Updates cells(). Returns the tiles of all levels that changed, were added or were removed.
  std::vector<TileKey> Render();
  [[nodiscard]] const std::map<TileKey, Cells>& cells() const { return sum_.cells(); }
  // The same of the tiles that say by how much the sessions that are shown differ (layer_disagreement.h). What changes
  // between two calls is computed at the next one only.
  std::vector<TileKey> RenderDisagreement();
  [[nodiscard]] const std::map<TileKey, Cells>& disagreement() const { return disagreement_.cells(); }
  // Frees them. The next RenderDisagreement makes all anew.
  void ForgetDisagreement();
  // Adds the grids of the sessions, and the cells and those of the disagreement.
  void Count(MemoryCount& memory) const;

 private:
  using Layers = std::map<SessionId, std::shared_ptr<const slam::GridChunk>>;

  // Of the sessions that `counts` accepts. Null: they have drawn nothing there.
  template <typename Counts>
  [[nodiscard]] std::shared_ptr<const slam::GridChunk> SumOf(const Layers& layers, const Counts& counts,
                                                             const LastLooks* last) const;
  void NoteLooks(SessionId session, const slam::OccupancyGrid::Looks& looks);
  void ForgetLooksThatMoved(SessionId session, const slam::OccupancyGrid::Chunks& chunks);
  [[nodiscard]] bool IsShown(const Layers& layers) const;
  void MarkChanged(SessionId session);
  void SetPastOrder(const std::vector<SessionId>& in_order);
  void SetLayer(slam::ChunkKey key, SessionId session, std::shared_ptr<const slam::GridChunk> chunk);
  // What the sessions have drawn there, or who is shown, has changed.
  void Touch(slam::ChunkKey key);
  [[nodiscard]] Cells Sum(slam::ChunkKey key) const;
  [[nodiscard]] Cells Disagreement(slam::ChunkKey key) const;

  const int most_past_;  // Log odds.
  std::map<slam::ChunkKey, Layers> chunks_;
  std::map<slam::ChunkKey, LastLooks> last_looks_;
  EditOverlay edits_;
  std::set<SessionId> hidden_;
  std::map<SessionId, std::size_t> past_;             // Sessions that have ended, and how many had before.
  std::set<slam::ChunkKey> dirty_, differing_dirty_;  // To be rendered.
  TilePyramid sum_, disagreement_;
};

}  // namespace cairn::server
