// Distances along rays to a fixed set of segments and to a few discs.
// Segments lie in a uniform grid that rays walk cell by cell; discs are few and tried one by one. Both sides of a
// segment stop a ray. A disc around the ray's origin does not, so that a scanner sees out of its own robot.
// Frame: `map`, metres. Immutable after construction: thread-safe.
// Source: grid walk of Amanatides, Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "client/sim/world.h"

namespace cairn::sim {

inline constexpr double kNothingHit = std::numeric_limits<double>::infinity();

class RayCaster {
 public:
  explicit RayCaster(std::vector<Segment> segments);

  // Distance to the nearest segment within `max_m`, else kNothingHit. `direction` has length 1.
  [[nodiscard]] double Cast(const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction, double max_m) const;

 private:
  [[nodiscard]] double CastInCell(std::size_t cell, const Eigen::Vector2d& origin,
                                  const Eigen::Vector2d& direction) const;

  std::vector<Segment> segments_;
  Eigen::Vector2d corner_map_ = Eigen::Vector2d::Zero();  // The lower left corner of cell (0,0).
  double cell_m_ = 1.0;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::uint32_t> cell_begin_;  // Where the members of cell i begin in members_; one entry more than cells.
  std::vector<std::uint32_t> members_;     // Segment indices.
};

// Distance along the ray to the segment; kNothingHit if it misses, runs alongside or lies behind.
[[nodiscard]] double CastAtSegment(const Segment& segment, const Eigen::Vector2d& origin_map,
                                   const Eigen::Vector2d& direction);

// Distance along the ray to the disc's rim; kNothingHit if it misses or starts inside.
[[nodiscard]] double CastAtDisc(const Disc& disc, const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction);

}  // namespace cairn::sim
