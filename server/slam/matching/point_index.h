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
// the search slow. Points are compared four at a time in single precision, and only those that may be the nearest in
// double precision: the answer is that of comparing all.
// Thread rule: built by one thread, then read from any thread.
class PointIndex {
 public:
  static constexpr std::int32_t kMaxInCell = 400;
  static constexpr std::int32_t kNone = -1;  // No point.

  explicit PointIndex(std::span<const SurfacePoint> points = {});

  void Clear();
  void Add(const SurfacePoint& point);
  // Forgets the points that were added first. REQUIRES: there are so many.
  void DropOldest(std::size_t count);
  // What a search found, for a later one that begins nearby.
  struct Found {
    std::int32_t point = kNone;
    Eigen::Vector2d at = Eigen::Vector2d::Zero();  // Where it searched.
    double clear_m = 0.0;                          // No other point is nearer to that place.
  };
  // The nearest point that is nearer than max_distance_m, or null; of several equally near ones of a cell, the last
  // that was added. Time grows with the square of max_distance_m where there is no point.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m) const {
    Found found;
    return Nearest(p, max_distance_m, found);
  }
  // The same answer, sooner if `last` is what an earlier search near to p left there since the reference set last
  // changed. A place that has moved less than the next point is away has the same answer as before, and otherwise the
  // point found before bounds the search.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m, Found& last) const;
  [[nodiscard]] std::size_t size() const { return points_.size() - dropped_; }

 private:
  using FourFloats = float __attribute__((vector_size(16)));
  // Points of one cell, in the order in which they were added, relative to its lower left corner. The coordinates of
  // many points lie side by side, because comparing them is the inner loop. Places that hold no point are far away.
  struct Block {
    static constexpr std::int32_t kPoints = 16;
    static constexpr float kFarM = 1e15F;
    Block() {
      x.fill(FourFloats{kFarM, kFarM, kFarM, kFarM});
      y = x;
    }
    std::array<FourFloats, kPoints / 4> x;
    std::array<FourFloats, kPoints / 4> y;
    std::array<std::int32_t, kPoints> point;  // Index in points_.
    std::int32_t size = 0;
    std::int32_t older = kNone;  // The block of this cell that was filled before.
  };
  struct Cell {
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t newest = kNone;  // Its last block; kNone in a slot of the table that is free.
  };
  struct Search;
  struct Borders;

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
  void LookAround(Search& search) const;
  void LookInto(std::int32_t i, std::int32_t j, Search& search) const;
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
