#include "server/slam/loops/region.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "server/slam/loops/one_per_cell.h"

namespace cairn::slam {
namespace {

// The raster of free space. Half or twice of each of these changes the results on the first 4500 scans of mit-killian
// no more than another seed (study `sensitivity`).
constexpr double kMaxRayM = 15.0;     // Beyond this range neighbouring beams leave gaps.
constexpr double kDrawEveryM = 0.75;  // Distance between the keyframes drawn.

bool IsDearer(const KeyframeCost& a, const KeyframeCost& b) {
  return a.cost != b.cost ? a.cost > b.cost : a.keyframe > b.keyframe;
}

}  // namespace

Stretch StretchAround(std::span<const KeyframeShape> shapes, std::size_t centre, double way_m) {
  // Bound to either side: turning on the spot makes many keyframes.
  constexpr std::size_t kMaxKeyframes = 200;
  Stretch stretch = NeighboursOf(shapes, centre, kMaxKeyframes);
  const double here = shapes[centre].travelled_m;
  while (here - shapes[stretch.first].travelled_m > way_m) ++stretch.first;
  while (shapes[stretch.last].travelled_m - here > way_m) --stretch.last;
  return stretch;
}

Stretch NeighboursOf(std::span<const KeyframeShape> shapes, std::size_t centre, std::size_t reach) {
  const auto follows = [&](std::size_t k) { return shapes[k].number == shapes[k - 1].number + 1; };
  Stretch stretch{centre, centre, centre};
  while (stretch.first > 0 && centre - stretch.first < reach && follows(stretch.first)) --stretch.first;
  while (stretch.last + 1 < shapes.size() && stretch.last - centre < reach && follows(stretch.last + 1)) ++stretch.last;
  return stretch;
}

std::size_t CountBefore(std::span<const KeyframeShape> shapes, double travelled_m, double way_m) {
  const auto before = [&](const KeyframeShape& shape) { return travelled_m - shape.travelled_m >= way_m; };
  return static_cast<std::size_t>(std::partition_point(shapes.begin(), shapes.end(), before) - shapes.begin());
}

std::vector<SurfacePoint> SurfacesOf(const Trail& trail, const Stretch& stretch, double cell_m) {
  std::vector<SurfacePoint> surfaces;
  OnePerCell cells(cell_m);
  ForEachSurface(trail, stretch, [&](const SurfacePoint& surface) {
    if (cells.Takes(surface.p)) surfaces.push_back(surface);
  });
  return surfaces;
}

void BestPlaces::Add(const KeyframeCost& candidate) {
  left_.push_back(candidate);
  std::push_heap(left_.begin(), left_.end(), IsDearer);
}

bool BestPlaces::Settle(double cost) {
  while (chosen_.size() < most_ && !left_.empty() && left_.front().cost < cost) {
    const std::size_t keyframe = left_.front().keyframe;
    std::pop_heap(left_.begin(), left_.end(), IsDearer);
    left_.pop_back();
    const bool same_place = std::any_of(chosen_.begin(), chosen_.end(), [&](std::size_t other) {
      return std::abs(shapes_[keyframe].travelled_m - shapes_[other].travelled_m) < apart_m_;
    });
    if (!same_place) chosen_.push_back(keyframe);
  }
  return chosen_.size() == most_;
}

std::vector<std::size_t> BestPlaces::Take() {
  Settle(std::numeric_limits<double>::infinity());
  return std::move(chosen_);
}

FreeSpace::FreeSpace(const Trail& trail, const Stretch& stretch, double cell_m) : cell_m_(cell_m) {
  const std::span<const Keyframe> keyframes = trail.keyframes();
  const std::span<const KeyframeShape> shapes = trail.shapes();
  struct Drawn {
    std::size_t keyframe;
    Pose2 T_anchor_robot;
  };
  std::vector<Drawn> drawn;
  Eigen::AlignedBox2d box;
  double drawn_m = -kDrawEveryM;
  for (std::size_t k = stretch.first; k <= stretch.last; ++k) {
    if (shapes[k].travelled_m - drawn_m < kDrawEveryM && k != stretch.last) continue;
    drawn_m = shapes[k].travelled_m;
    drawn.push_back({k, Between(shapes[stretch.anchor].T_track_robot, shapes[k].T_track_robot)});
    // A ray starts at the laser, which may sit some way from the robot's origin.
    const double reach = kMaxRayM + keyframes[k].scan->T_robot_laser.translation().norm() + 2.0 * cell_m_;
    box.extend(drawn.back().T_anchor_robot.translation() - Eigen::Vector2d::Constant(reach));
    box.extend(drawn.back().T_anchor_robot.translation() + Eigen::Vector2d::Constant(reach));
  }
  low_x_ = static_cast<int>(std::floor(box.min().x() / cell_m_));
  low_y_ = static_cast<int>(std::floor(box.min().y() / cell_m_));
  width_ = static_cast<int>(std::ceil(box.max().x() / cell_m_)) - low_x_ + 1;
  height_ = static_cast<int>(std::ceil(box.max().y() / cell_m_)) - low_y_ + 1;
  cells_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), Seen::kNot);

  ScanRaster raster;
  const RasterOptions raster_options{.resolution_m = cell_m_, .max_ray_m = kMaxRayM, .no_return_free_m = 0.0};
  for (const Drawn& one : drawn) {
    const auto note = [&](GridCell first, const ScanRaster::Piece& marks) {
      const int y = first.y - low_y_;
      if (y < 0 || y >= height_) return;
      for (int i = 0; i < ScanRaster::kPiece; ++i) {
        const std::uint8_t mark = marks[static_cast<std::size_t>(i)];
        const int x = first.x + i - low_x_;
        if (mark == ScanRaster::kUntouched || x < 0 || x >= width_) continue;
        Seen& seen =
            cells_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
        seen = std::max(seen, mark > ScanRaster::kPassed ? Seen::kHit : Seen::kThrough);
      }
    };
    raster.Rasterise(*keyframes[one.keyframe].scan, one.T_anchor_robot, raster_options, note);
  }
}

bool FreeSpace::Contradicts(const Eigen::Vector2d& p_anchor) const {
  const int x = static_cast<int>(std::floor(p_anchor.x() / cell_m_)) - low_x_,
            y = static_cast<int>(std::floor(p_anchor.y() / cell_m_)) - low_y_;
  if (x < 1 || y < 1 || x + 1 >= width_ || y + 1 >= height_) return false;
  for (int row = y - 1; row <= y + 1; ++row)
    for (int column = x - 1; column <= x + 1; ++column)
      if (cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(column)] !=
          Seen::kThrough)
        return false;
  return true;
}

}  // namespace cairn::slam
