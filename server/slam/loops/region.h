// The surroundings of a keyframe (the anchor) as seen from the keyframes around it, in the robot frame of the
// anchor: surfaces, and free space where beams passed. Its errors are those of the front-end over the
// stretch. Made for one comparison. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/grid/scan_raster.h"
#include "server/slam/scan/surface_points.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// An old place that is farther away along the known relations belongs to a large loop (LoopSearch), and a nearer one to
// a revisit (RevisitSearch), so that no place lies between the two searches. Half or twice the value changes the
// results no more than another seed (study `sensitivity`).
inline constexpr double kLargeLoopM = 60.0;

// The keyframes [first, last], with poses relative to `anchor`.
struct Stretch {
  std::size_t first = 0;
  std::size_t last = 0;
  std::size_t anchor = 0;
};

// How many of the first keyframes lie at least `way_m` of the way before the place to which the robot has travelled
// `travelled_m`.
[[nodiscard]] std::size_t CountBefore(std::span<const KeyframeShape> shapes, double travelled_m, double way_m);

// Returns the keyframes within a travelled distance of `way_m` before and after `centre`. It ends where keyframes are
// retired, because the front-end has drifted since.
[[nodiscard]] Stretch StretchAround(std::span<const KeyframeShape> shapes, std::size_t centre, double way_m);
// Returns the same number of keyframes, or fewer, before and after `centre`.
[[nodiscard]] Stretch NeighboursOf(std::span<const KeyframeShape> shapes, std::size_t centre, std::size_t reach);

// Calls visit(point) for every surface point of the stretch, in the frame of the anchor and in the order of
// the keyframes.
template <typename Visit>
void ForEachSurface(const Trail& trail, const Stretch& stretch, const Visit& visit) {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  for (std::size_t k = stretch.first; k <= stretch.last; ++k) {
    const Pose2 T_anchor_k = Between(shapes[stretch.anchor].T_track_robot, shapes[k].T_track_robot);
    const Eigen::Matrix2d R = T_anchor_k.rotation();
    const SharedPoints points = trail.points(k);
    for (const SurfacePoint& point : *points)
      visit(SurfacePoint{R * point.p + T_anchor_k.translation(), R * point.normal});
  }
}

// Returns the surface points of the stretch, one per cell of `cell_m`, in the order of the keyframes.
[[nodiscard]] std::vector<SurfacePoint> SurfacesOf(const Trail& trail, const Stretch& stretch, double cell_m);

// An old keyframe that a search may use; those of the lowest cost come first.
struct KeyframeCost {
  std::size_t keyframe = 0;
  double cost = 0.0;
};

// Chooses at most `most` keyframes in the order of their costs (of equal ones in the order of the keyframes), and only
// one per place: no two are nearer to each other along the path than `apart_m`.
class BestPlaces {
 public:
  // `shapes` must outlive it.
  BestPlaces(std::span<const KeyframeShape> shapes, double apart_m, std::size_t most)
      : shapes_(shapes), apart_m_(apart_m), most_(most) {}

  void Add(const KeyframeCost& candidate);
  // No candidate that costs less than this will be added any more. Returns whether all are chosen.
  bool Settle(double cost);
  // All candidates have been added.
  [[nodiscard]] std::vector<std::size_t> Take();

 private:
  std::span<const KeyframeShape> shapes_;
  double apart_m_;
  std::size_t most_;
  std::vector<KeyframeCost> left_;  // A heap with the cheapest on top.
  std::vector<std::size_t> chosen_;
};

// The space through which beams of a stretch passed and in which none ended.
class FreeSpace {
 public:
  FreeSpace(const Trail& trail, const Stretch& stretch, double cell_m);

  // True if beams passed this point and none ended within a cell of it.
  [[nodiscard]] bool Contradicts(const Eigen::Vector2d& p_anchor) const;

 private:
  enum class Seen : std::uint8_t { kNot = 0, kThrough, kHit };

  double cell_m_;
  int low_x_ = 0, low_y_ = 0;
  int width_ = 0, height_ = 0;
  std::vector<Seen> cells_;
};

}  // namespace cairn::slam
