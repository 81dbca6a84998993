// The surroundings of a keyframe as the keyframes about it saw them, in the robot frame of that anchor: surfaces, and
// where beams went through. True to itself as far as the front-end drifts over the stretch. Scratch for one comparison.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/grid/scan_raster.h"
#include "server/slam/keyframe.h"
#include "server/slam/matching/surface_points.h"

namespace cairn::slam {

// What matching needs to know of a keyframe.
struct KeyframeShape {
  Pose2 T_track_robot;               // Front-end frame: true to its neighbours, drifting over the whole.
  double travelled_m = 0.0;          // Along the path up to it.
  std::vector<SurfacePoint> points;  // In its robot frame.
};

// Keyframes [first, last] seen from `anchor`.
struct Stretch {
  std::size_t first = 0;
  std::size_t last = 0;
  std::size_t anchor = 0;
};

// The keyframes within `way_m` of travel before and after `centre`.
[[nodiscard]] Stretch StretchAround(std::span<const KeyframeShape> shapes, std::size_t centre, double way_m);

// Their surface points, one per cell of `cell_m`, in the order of sight.
[[nodiscard]] std::vector<SurfacePoint> SurfacesOf(std::span<const KeyframeShape> shapes, const Stretch& stretch,
                                                   double cell_m);

// Where the beams of a stretch went through without ever ending nearby.
class FreeSpace {
 public:
  FreeSpace(std::span<const Keyframe> keyframes, std::span<const KeyframeShape> shapes, const Stretch& stretch);

  // Seen through, and nothing was hit within a cell of it.
  [[nodiscard]] bool Contradicts(const Eigen::Vector2d& p_anchor) const;

 private:
  static constexpr double kCellM = 0.2;
  static constexpr double kMaxRayM = 15.0;  // Beyond, neighbouring beams leave gaps.
  static constexpr double kEveryM = 0.75;   // Between the keyframes drawn.
  enum class Seen : std::uint8_t { kNot = 0, kThrough, kHit };

  int low_x_ = 0, low_y_ = 0;
  int width_ = 0, height_ = 0;
  std::vector<Seen> cells_;
};

}  // namespace cairn::slam
