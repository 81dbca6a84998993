// Finds the nearest surface point of a reference set. Most of the estimator's time is spent here.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

// The plane is divided into small square cells, which a hash table finds. A search looks into the cell of the place and
// then into the rings of cells around it, until no cell that is left can hold a nearer point. Of a cell only the last
// kMaxInCell points are compared, far more than a wall that was seen forty times puts there, so that no scan can make
// the search slow. Points are compared sixteen at a time with single precision; only those that may be the nearest are
// compared exactly. Thread rule: built by one thread, then read from any thread.
class PointIndex {
 public:
  static constexpr std::int32_t kMaxInCell = 400;
  // No point is known, see Nearest.
  static constexpr std::int32_t kNone = -1;

  explicit PointIndex(std::span<const SurfacePoint> points = {});

  void Clear();
  void Add(const SurfacePoint& point);
  // Forgets the points that were added first. REQUIRES: there are so many.
  void DropOldest(std::size_t count);
  // The nearest point that is nearer than max_distance_m, or null; of several equally near ones of a cell, the last
  // that was added. Time grows with the square of max_distance_m where there is no point.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m) const {
    std::int32_t any = kNone;
    return Nearest(p, max_distance_m, any);
  }
  // The same, faster if `likely` is a point nearby: kNone or what an earlier search of the same reference set left
  // there. It is set to the point that was found, if there is one. It does not change the answer.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m,
                                            std::int32_t& likely) const;
  [[nodiscard]] std::size_t size() const { return points_.size() - dropped_; }

 private:
  // Points of one cell, in the order in which they were added, relative to the cell's corner. The coordinates of many
  // points lie side by side, because comparing them is the inner loop. Places without a point are far away.
  struct Block {
    static constexpr std::int32_t kPoints = 16;
    static constexpr float kFarM = 1e15F;
    Block() {
      x.fill(kFarM);
      y.fill(kFarM);
    }
    alignas(16) std::array<float, kPoints> x;
    alignas(16) std::array<float, kPoints> y;
    std::array<std::int32_t, kPoints> point;  // Index in points_.
    std::int32_t size = 0;
    std::int32_t older = -1;  // The block of this cell that was filled before, or -1.
  };
  struct Cell {
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t newest = -1;  // Its last block, or -1 in a slot of the table that is free.
  };
  // The search so far: every point whose squared distance is at least `squared_m2` is not nearer.
  struct Best {
    explicit Best(double squared) { Set(squared, kNone); }
    void Set(double squared, std::int32_t at);
    double squared_m2 = 0.0;
    std::int32_t point = kNone;
    float may_be_nearer_m2 = 0.0F;  // Above `squared_m2` by more than the error of single precision.
  };

  // The number of rings of cells round a place that hold no point, for every place. The number may be too small:
  // distant places share one, and it does not grow when points are dropped.
  class EmptyRings {
   public:
    static constexpr std::int32_t kMost = 5;  // Where there are more, the number is this.
    void Clear();
    void Fill(std::int32_t x, std::int32_t y);
    // REQUIRES: Fill was called before.
    [[nodiscard]] std::int32_t Around(std::int32_t x, std::int32_t y) const;

   private:
    static constexpr std::int32_t kSide = 256;
    std::vector<std::uint8_t> rings_;  // Allocated by the first Fill: most robots of a fleet may never drive.
  };

  [[nodiscard]] std::size_t SlotOf(std::int32_t x, std::int32_t y) const;
  void LookInto(std::int32_t x, std::int32_t y, const Eigen::Vector2d& p, Best& best) const;
  void Grow();

  std::vector<Cell> table_;  // Open addressing; at most half full. The size is a power of two.
  std::size_t cells_ = 0;    // Slots in use.
  EmptyRings empty_rings_;
  std::vector<Block> blocks_;
  // Dropped points stay, at the front and in their blocks, until they are half of all.
  std::vector<SurfacePoint> points_;
  std::size_t dropped_ = 0;
};

}  // namespace cairn::slam
