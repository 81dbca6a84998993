// What people have said about a site's map (common/map/map_edit.h), and the cells that this gives. They are a layer
// above all that robots have drawn; where edits overlap, the later one counts. An edit moves with the keyframes on
// which it hangs (edit_anchors.h). Not thread-safe: used on the site's strand only. The functions are stateless.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "common/map/map_edit.h"
#include "common/map/tile.h"
#include "server/maps/edit_anchors.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

// Of a tile of level 0; cells that no edit gives are kAsDrawn.
using EditOverlay = std::map<slam::ChunkKey, std::shared_ptr<const TileCells>>;
inline constexpr std::uint8_t kAsDrawn = 254;
// Tiles of an overlay: 64 MiB.
inline constexpr std::size_t kMostOverlayTiles = 4096;

// Draws the edit over what is in the overlay, which stays as it was where it would have more than kMostOverlayTiles
// (false). Nothing: the cells stay as they are drawn. `only`, if not null: no other tiles than these.
[[nodiscard]] bool DrawEdit(const MapEdit& edit, std::optional<std::uint8_t> cell, double resolution_m,
                            const std::set<slam::ChunkKey>* only, EditOverlay& overlay);
// The tiles in which the edit has cells.
[[nodiscard]] std::set<slam::ChunkKey> TilesOf(const MapEdit& edit, double resolution_m);
// Puts what the overlay of a tile gives over its cells.
void DrawOver(const TileCells& overlay, TileCells& cells);

class MapEdits {
 public:
  MapEdits(double resolution_m, std::size_t most);

  // Gives the edit its number and returns it. INVALID_ARGUMENT: ValidateMapEdit. RESOURCE_EXHAUSTED: there are as many
  // as there may be, they cover too many tiles, or no numbers are left. Takes time for the edit's area.
  Result<std::uint64_t> Add(MapEdit edit, EditAnchors anchors = {});
  // NOT_FOUND: there is no such edit. Takes time for the areas of all edits, and draws only in the tiles of this one.
  Result<void> Remove(std::uint64_t id);
  // Takes the place of all that was, and calls `advance` after each. Returns how many were left out, because they cover
  // too many tiles. REQUIRES: `all` are valid, and their numbers are at most `version`.
  std::size_t Restore(std::vector<MapEdit> all, std::uint64_t version, const std::function<void()>& advance,
                      std::map<std::uint64_t, EditAnchors> anchors = {});
  // Each edit for which `is_lost` is true hangs on what `anchors_of` returns from now on, starting from where it lies
  // now. If that returns nothing, the edit keeps its keyframes. Returns whether any has changed.
  using Anchoring = std::function<std::optional<EditAnchors>(const MapEdit& edit)>;
  bool AnchorAgain(const std::function<bool(const EditAnchors&)>& is_lost, const Anchoring& anchors_of);
  // The keyframes lie there now: moves the edits that hang on them. One that would be no valid edit any more (too far
  // away) stays, and so do all if they would cover too many tiles. Returns whether any has moved; then all that have
  // moved make one version.
  bool Follow(const DrawnPaths& paths);
  // Removes all of them.
  void Clear();

  // In the order in which they were added. Immutable, also while others read it.
  [[nodiscard]] const std::shared_ptr<const std::vector<MapEdit>>& all() const { return all_; }
  // Grows with every change; 0: there was none. An edit's number is the version that it made.
  [[nodiscard]] std::uint64_t version() const { return version_; }
  [[nodiscard]] const EditOverlay& overlay() const { return overlay_; }
  [[nodiscard]] const std::map<std::uint64_t, EditAnchors>& anchors() const { return anchors_; }

 private:
  // The overlay with these tiles drawn anew. Nothing: there would be too many.
  [[nodiscard]] std::optional<EditOverlay> Redrawn(const std::vector<MapEdit>& edits,
                                                   const std::set<slam::ChunkKey>& tiles) const;

  const double resolution_m_;
  const std::size_t most_;
  std::shared_ptr<const std::vector<MapEdit>> all_ = std::make_shared<std::vector<MapEdit>>();
  std::uint64_t version_ = 0;
  EditOverlay overlay_;
  std::map<std::uint64_t, EditAnchors> anchors_;  // By the number of the edit.
};

}  // namespace cairn::server
