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

// The plane is divided into small square cells, which a hash table finds, and each cell into four quarters. A search
// looks into the cell of the place and then into the rings of cells around it, until no cell that is left can hold a
// nearer point. Of a quarter only the last kMaxInQuarter points are compared, far more than a wall that was seen forty
// times puts there, so that no scan can make the search slow. The points of a quarter are compared sixteen at a time in
// single precision, and only those that may be the nearest in double precision: the answer is that of comparing all.
// Thread rule: built by one thread, then read from any thread.
class PointIndex {
 public:
  static constexpr std::int32_t kMaxInQuarter = 400;
  static constexpr std::int32_t kNone = -1;  // No point, see Nearest.

  explicit PointIndex(std::span<const SurfacePoint> points = {});

  void Clear();
  void Add(const SurfacePoint& point);
  // Forgets the points that were added first. REQUIRES: there are so many.
  void DropOldest(std::size_t count);
  // The nearest point that is nearer than max_distance_m, or null; of several equally near ones of a cell, the last
  // that was added. Time grows with the square of max_distance_m where there is no point.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m) const {
    std::int32_t likely = kNone;
    return Nearest(p, max_distance_m, likely);
  }
  // The same answer, sooner if `likely` is near to p: it is what an earlier search left there since the reference set
  // last changed, or kNone. The point that is found is left there.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m,
                                            std::int32_t& likely) const;
  [[nodiscard]] std::size_t size() const { return points_.size() - dropped_; }

 private:
  // Points of one quarter, in the order in which they were added, relative to the lower left corner of the cell. The
  // coordinates of many points lie side by side, because comparing them is the inner loop. Places that hold no point are
  // far away.
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
    std::int32_t older = kNone;  // The block of this quarter that was filled before.
  };
  struct Cell {
    std::int32_t x = 0;
    std::int32_t y = 0;
    bool used = false;  // It holds a point; if not, this slot of the table is free.
    // The last block of each quarter: lower left, lower right, upper left, upper right.
    std::array<std::int32_t, 4> newest = {kNone, kNone, kNone, kNone};
  };
  // The search so far: points that are not nearer than squared_m2 do not count.
  struct Best {
    explicit Best(double squared) { Set(squared, kNone); }
    void Set(double squared, std::int32_t at);
    double squared_m2 = 0.0;
    std::int32_t point = kNone;
    float may_be_nearer_m2 = 0.0F;  // Larger than squared_m2 by more than the error of single precision.
  };
  // A place, and how far the cells and quarters around it are at least.
  struct Place;

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
  void LookInto(const Place& place, std::int32_t i, std::int32_t j, Best& best) const;
  void Compare(const Place& place, std::int32_t i, std::int32_t j, std::int32_t newest, std::int32_t before,
               Best& best) const;
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
