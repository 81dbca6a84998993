// The growing map of one robot: every keyframe is drawn onto the grid at the filter's estimate of its pose at
// that time, except keyframes that are not localized (Keyframe::localized): they are part of the path only.
// When the past path changes (a large loop), the whole map is drawn again along the new path, some
// keyframes with every scan, so that no scan has to wait. Until that is finished the old map is kept. A map that has
// taken the place of another one may lack keyframes, thousands where a site goes back to an old map: these are late,
// and drawn onto it some at a time (DrawLate), in their order, the new ones after them. When that happens changes
// nothing but the grid until then, so late keyframes are no part of a checkpoint: they are drawn before it. Frames:
// `map`. Not thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/state/frozen_blocks.h"
#include "server/slam/trail/keyframe.h"
#include "server/slam/trail/pose_path.h"
#include "server/slam/trail/retirement.h"

namespace cairn::slam {

class MapDrawing {
 public:
  explicit MapDrawing(const GridOptions& options) : grid_(options) {}

  // Draws the next keyframe at this pose; after those before it, if these are not drawn yet.
  void Add(const Keyframe& keyframe, const Pose2& T_map_robot);
  // The poses of all keyframes have changed, when there had been so many (Trail::made): begins to draw them again.
  void StartAgain(std::uint64_t made);
  // For keyframes that could not be drawn before, because their place in the map was not known, and that now
  // lie along `path`: draws the last of them, and then begins to draw all of them.
  void Begin(std::span<const Keyframe> keyframes, const PosePath& path);
  // Draws some more keyframes at their poses in `path`. Once all are drawn, the new map replaces the old one. Also
  // draws some late ones.
  void Continue(std::span<const Keyframe> keyframes, const PosePath& path);
  // Draws some of the late keyframes, or all.
  void DrawLate(std::span<const Keyframe> keyframes);
  void DrawAllLate(std::span<const Keyframe> keyframes);
  // Like Continue, but draws all remaining keyframes.
  void Finish(std::span<const Keyframe> keyframes, const PosePath& path);
  // Replaces the map by one that a job drew when there had been `made` keyframes, of which the first `drawn` are left,
  // and draws the later ones onto it, at once if they are as few as Continue draws. A map from before a change of the
  // path is also taken, and then drawn again. `along_path`: the given map goes with `path`, which has changed with it.
  // `in_grid`: the poses at which the first keyframes are drawn in it; empty: not known.
  void Adopt(OccupancyGrid grid, std::uint64_t made, std::size_t drawn, std::span<const Keyframe> keyframes,
             const PosePath& path, bool along_path = false, std::span<const Pose2> in_grid = {});

  // Keyframes are retired: what they have drawn stays. REQUIRES: neither redrawing() nor late().
  void Retire(const Retirement& retirement);

  // How many keyframes there had been when the path changed last.
  [[nodiscard]] std::uint64_t changed_at() const { return changed_at_; }
  [[nodiscard]] bool redrawing() const { return redraw_.has_value(); }
  [[nodiscard]] bool late() const { return late_ > 0; }
  // So many of the first keyframes are drawn in the grid.
  [[nodiscard]] std::size_t drawn() const { return path_.size() - late_; }
  [[nodiscard]] const OccupancyGrid& grid() const { return grid_; }
  [[nodiscard]] OccupancyGrid::Chunks Share() { return grid_.Share(); }
  [[nodiscard]] OccupancyGrid::Change TakeChange() { return grid_.TakeChange(); }
  // The cells that Add has touched since the last call, or since the whole grid was replaced. What is drawn again is
  // not looked at again.
  [[nodiscard]] OccupancyGrid::Looks TakeLooks() { return std::exchange(looks_, {}); }
  // T_map_robot of every keyframe in the drawing, also of those that are not drawn yet.
  [[nodiscard]] const std::vector<Pose2>& path() const { return path_; }

  // REQUIRES: not late().
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    bool redrawing = self.redrawing();
    InBlocks(archive, self.frozen_path_, self.path_);
    archive(self.grid_, redrawing, self.changed_at_);
    if constexpr (Archive::kReads) {
      self.redraw_.reset();
      if (redrawing) self.redraw_.emplace(Redraw{OccupancyGrid(self.grid_.options()), 0});
    }
    if (redrawing) archive(self.redraw_->grid, self.redraw_->drawn);
    if constexpr (Archive::kReads) self.late_ = 0;
  }

 private:
  struct Redraw {
    OccupancyGrid grid;
    std::size_t drawn = 0;  // Number of keyframes drawn.
  };

  OccupancyGrid grid_;
  OccupancyGrid::Looks looks_;  // Not part of checkpoints: after a restart the whole grid is reported.
  std::vector<Pose2> path_;
  FrozenBlocks<Pose2> frozen_path_;  // For checkpoints.
  std::optional<Redraw> redraw_;     // The new map, while it is being drawn after a change of the path.
  std::uint64_t changed_at_ = 0;     // How many keyframes there had been when the path changed.
  std::size_t late_ = 0;             // How many of the last keyframes are not drawn in `grid_` yet.
};

}  // namespace cairn::slam
