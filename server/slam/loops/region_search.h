// Finds the pose in a search window at which a set of points fits best on a reference set. Exhaustive within
// the window down to its cell and angle step, but evaluates few poses. Ambiguity is left to the caller, who
// can search again with the best pose excluded: in a corridor a rival scores almost as high. Frames: points
// in `curr`, pyramid in `ref`. Stateless, thread-safe, deterministic.
// Source: branch and bound of Hess et al., ICRA 2016, section V.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

// The likelihood of points, given the surfaces of a reference set, for fast evaluation of many poses: a
// raster of 0..255 (255 on a reference point, falling to 0 at `reach_m`), and coarser rasters that hold the
// maximum of every block. The value of a coarse cell is an upper bound for every pose inside it, so that a
// search can skip most poses.
// Frame: that of the reference points. Immutable after construction; any thread may read.
// Source: multi-resolution correlative matching of Olson, ICRA 2009; bounds as in Hess et al., ICRA 2016,
// section V.
class LikelihoodPyramid {
 public:
  // Points that a pose moves out of the raster score 0. REQUIRES: 2^(levels - 1) <= 64 cells.
  LikelihoodPyramid(std::span<const SurfacePoint> reference, double cell_m, double reach_m, int levels);

  // The maximum over the 2^level x 2^level cells with (x, y) as the lower left one, in cells of level 0.
  [[nodiscard]] std::uint8_t Best(int level, int x, int y) const {
    const int column = x + kPad - low_x_, row = y + kPad - low_y_;
    if (column < 0 || row < 0 || column >= width_ || row >= height_) return 0;
    return levels_[static_cast<std::size_t>(level)][static_cast<std::size_t>(row * width_ + column)];
  }
  struct Cell {
    int x = 0;
    int y = 0;
  };
  // The cells of points at one heading, in kParts parts.
  static constexpr std::size_t kParts = 8;
  struct Pattern {
    std::vector<Cell> cells;
    // Of the cells, from the lowest one, within the rasters of the pyramid that it was made for.
    std::vector<std::ptrdiff_t> offsets;
    Cell low, high;  // No cell is lower or higher.
  };
  [[nodiscard]] Pattern PatternOf(std::vector<Cell> cells) const;
  // Sums over the parts from each part on: the first is the sum over all cells.
  using SumsFrom = std::array<std::int32_t, kParts + 1>;
  // The sums of Best over the cells of a pattern that is moved by (x, y), or, if that over all cells is at most
  // `enough`, any numbers of which the first is so. `at_most`: no sum is larger.
  [[nodiscard]] SumsFrom SumsOfBest(int level, const Pattern& pattern, int x, int y, std::int32_t enough,
                                    const SumsFrom& at_most) const;
  // Sums that none exceeds.
  [[nodiscard]] static SumsFrom MostOf(const Pattern& pattern);
  // For each element i of `sums` the sum of Best on the coarsest level over cells that are moved by
  // (x + i * 2^level, y): a row of blocks side by side, in a fraction of the time that they would take one by one.
  void SumsOfRow(std::span<const Cell> cells, int x, int y, std::span<std::int64_t> sums) const;
  [[nodiscard]] double cell_m() const { return cell_m_; }
  [[nodiscard]] int levels() const { return static_cast<int>(levels_.size()); }

 private:
  // Border in cells: blocks that begin left of or below the points still contain some of them.
  static constexpr int kPad = 64;

  double cell_m_;
  int low_x_ = 0, low_y_ = 0;  // Lowest cell of the points.
  int width_ = 0, height_ = 0;
  std::vector<std::vector<std::uint8_t>> levels_;  // Rasters by level, each row-major, width_ x height_.
  // The coarsest raster once more: within each row first the columns 0, 2^level, 2 * 2^level..., then those one further
  // and so on, so that what a point reads for a row of blocks lies side by side.
  std::vector<std::uint8_t> by_phase_;
  std::size_t blocks_in_row_ = 0;
};

struct SearchWindow {
  Pose2 T_ref_curr_centre;
  double reach_m = 5.0;    // To either side in x and y.
  double reach_rad = 0.3;  // To either side.
};

struct RegionPeak {
  Pose2 T_ref_curr;
  double score = 0.0;  // Mean likelihood of the points, 0..1.
  // False if the search ended at its bound on work, so that a better pose may have been missed.
  bool complete = true;
};

// Poses this near to `T_ref_curr` are left out.
struct Exclusion {
  Pose2 T_ref_curr;
  double radius_m = 1.0;
  double radius_rad = 0.2;
};

// At most so many blocks are evaluated by a search.
inline constexpr int kMaxBlocks = 1'000'000;

// A search that can be done in several parts, for a caller that has not the time to wait for all of it. The pyramid
// must outlive it. Copyable.
class PoseSearch {
 public:
  using Pattern = LikelihoodPyramid::Pattern;

  PoseSearch(std::span<const Eigen::Vector2d> points_curr, const LikelihoodPyramid& pyramid,
             const SearchWindow& window);

  // Begins to look for the best pose with a score above `min_score`, without those near any of `exclusions`. `any`: the
  // search ends at the first pose that it finds.
  void Begin(double min_score, std::span<const Exclusion> exclusions = {}, bool any = false);
  // Goes on until about so many blocks more are evaluated. Returns whether the search has ended.
  bool GoOn(int blocks);
  // Of a search that has ended.
  [[nodiscard]] std::optional<RegionPeak> peak() const;

 private:
  // A square block of translations at one heading, with an upper bound of their scores.
  struct Block {
    int turn = 0;  // Index of the heading.
    int x = 0;     // Lowest translation, in cells.
    int y = 0;
    int level = 0;
    LikelihoodPyramid::SumsFrom sums{};  // Upper bounds of the sums over the points.

    [[nodiscard]] std::int32_t bound() const { return sums.front(); }
  };
  [[nodiscard]] Pose2 PoseOf(const Block& block) const;
  [[nodiscard]] bool Excluded(const Block& block) const;
  [[nodiscard]] const Pattern& PatternOf(const Block& block) const {
    return turned_[static_cast<std::size_t>(block.turn)];
  }
  [[nodiscard]] bool LookOnAtCoarsest(int end);
  void Divide(const Block& block);

  const LikelihoodPyramid* pyramid_;
  SearchWindow window_;
  double step_rad_ = 0.0;
  int reach_turns_ = 0;
  int reach_cells_ = 0;
  double full_ = 0.0;            // The sum over the points if all lie on a surface.
  std::vector<Pattern> turned_;  // The cells of the points at each heading.
  // The bounds of blocks of the coarsest level, as far as they are known: a second search begins with the same ones.
  std::vector<std::int32_t> coarsest_;

  std::vector<Exclusion> exclusions_;
  bool any_ = false;
  bool looked_at_coarsest_ = false;
  std::size_t next_row_ = 0;  // The row of blocks of the coarsest level that is looked at next.
  std::vector<Block> left_;   // Those that may hold a better pose; the next one comes last.
  Block best_;
  bool found_ = false;
  int scored_ = 0;
};

// Returns the best pose with a score above `min_score`, or nothing.
[[nodiscard]] std::optional<RegionPeak> FindBestPose(std::span<const Eigen::Vector2d> points_curr,
                                                     const LikelihoodPyramid& pyramid, const SearchWindow& window,
                                                     double min_score,
                                                     const std::optional<Exclusion>& exclusion = std::nullopt);
// The same, without the poses near any of several.
[[nodiscard]] std::optional<RegionPeak> FindBestPose(std::span<const Eigen::Vector2d> points_curr,
                                                     const LikelihoodPyramid& pyramid, const SearchWindow& window,
                                                     double min_score, std::span<const Exclusion> exclusions);

}  // namespace cairn::slam
