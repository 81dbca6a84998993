// Takes the first point of each cell of a raster. Memory is that of the points taken, not of the area. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cairn::slam {

class OnePerCell {
 public:
  explicit OnePerCell(double cell_m) : cell_m_(cell_m) {}
  [[nodiscard]] bool Takes(const Eigen::Vector2d& p);

 private:
  // Where a cell is, or would be put.
  [[nodiscard]] std::size_t SlotOf(std::uint64_t cell) const;
  void Grow();

  // Of cells beyond all coordinates that occur.
  static constexpr std::uint64_t kNone = 0x80000000'80000000;

  double cell_m_;
  std::vector<std::uint64_t> taken_ = std::vector<std::uint64_t>(1024, kNone);  // A table with open addressing.
  std::size_t count_ = 0;
};

}  // namespace cairn::slam
