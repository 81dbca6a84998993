#include "client/sim/ray_caster.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::sim {
namespace {

constexpr double kWantedCell_m = 0.5;
constexpr int kMaxCellsPerSide = 1024;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// The part of the ray inside [low, high] on one axis, narrowing [enter, leave].
void ClipAxis(double origin, double direction, double low, double high, double* enter, double* leave) {
  if (direction == 0.0) {
    if (origin < low || origin > high) *leave = -1.0;
    return;
  }
  double a = (low - origin) / direction, b = (high - origin) / direction;
  if (a > b) std::swap(a, b);
  *enter = std::max(*enter, a);
  *leave = std::min(*leave, b);
}

}  // namespace

double CastAtSegment(const Segment& segment, const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction) {
  // A little overlap at the ends, so that no ray slips through the joint of two segments.
  constexpr double kEndSlack = 1e-9;
  const Eigen::Vector2d edge = segment.b_map - segment.a_map, to_a = segment.a_map - origin_map;
  const double denominator = Cross(direction, edge);
  if (std::abs(denominator) < 1e-12) return kNothingHit;  // Along the wall: its neighbours end the ray.
  const double distance = Cross(to_a, edge) / denominator, share = Cross(to_a, direction) / denominator;
  if (distance < 0.0 || share < -kEndSlack || share > 1.0 + kEndSlack) return kNothingHit;
  return distance;
}

RayCaster::RayCaster(std::vector<Segment> segments) : segments_(std::move(segments)) {
  if (segments_.empty()) return;
  Eigen::Vector2d low = segments_.front().a_map, high = low;
  for (const Segment& s : segments_) {
    low = low.cwiseMin(s.a_map).cwiseMin(s.b_map);
    high = high.cwiseMax(s.a_map).cwiseMax(s.b_map);
  }
  corner_map_ = low.array() - 1e-6;
  const Eigen::Vector2d size = (high - corner_map_).array() + 1e-6;
  cell_m_ = std::max(kWantedCell_m, size.maxCoeff() / kMaxCellsPerSide);
  columns_ = static_cast<int>(size.x() / cell_m_) + 1;
  rows_ = static_cast<int>(size.y() / cell_m_) + 1;

  // Every cell the segment's line touches within its bounding box, with a margin far above rounding.
  const double reach = cell_m_ * 0.5 * std::sqrt(2.0) + 1e-6;
  std::vector<std::vector<std::uint32_t>> cells(static_cast<std::size_t>(columns_) * rows_);
  for (std::uint32_t i = 0; i < segments_.size(); ++i) {
    const Segment& s = segments_[i];
    const auto column = [&](double x) { return std::clamp(static_cast<int>(x / cell_m_), 0, columns_ - 1); };
    const auto row = [&](double y) { return std::clamp(static_cast<int>(y / cell_m_), 0, rows_ - 1); };
    const Eigen::Vector2d a = s.a_map - corner_map_, b = s.b_map - corner_map_;
    const double margin = 1e-6;
    const double length = (b - a).norm();
    for (int y = row(std::min(a.y(), b.y()) - margin); y <= row(std::max(a.y(), b.y()) + margin); ++y) {
      for (int x = column(std::min(a.x(), b.x()) - margin); x <= column(std::max(a.x(), b.x()) + margin); ++x) {
        const Eigen::Vector2d center((x + 0.5) * cell_m_, (y + 0.5) * cell_m_);
        if (length > 0.0 && std::abs(Cross(b - a, center - a)) / length > reach) continue;
        cells[static_cast<std::size_t>(y) * columns_ + x].push_back(i);
      }
    }
  }
  cell_begin_.reserve(cells.size() + 1);
  for (const auto& cell : cells) {
    cell_begin_.push_back(static_cast<std::uint32_t>(members_.size()));
    members_.insert(members_.end(), cell.begin(), cell.end());
  }
  cell_begin_.push_back(static_cast<std::uint32_t>(members_.size()));
}

double RayCaster::CastInCell(std::size_t cell, const Eigen::Vector2d& origin, const Eigen::Vector2d& direction) const {
  double nearest = kNothingHit;
  for (std::uint32_t i = cell_begin_[cell]; i < cell_begin_[cell + 1]; ++i) {
    nearest = std::min(nearest, CastAtSegment(segments_[members_[i]], origin, direction));
  }
  return nearest;
}

double RayCaster::Cast(const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction, double max_m) const {
  if (segments_.empty()) return kNothingHit;
  const Eigen::Vector2d origin = origin_map - corner_map_;
  double enter = 0.0, leave = max_m;
  ClipAxis(origin.x(), direction.x(), 0.0, columns_ * cell_m_, &enter, &leave);
  ClipAxis(origin.y(), direction.y(), 0.0, rows_ * cell_m_, &enter, &leave);
  if (enter > leave) return kNothingHit;

  const Eigen::Vector2d p = origin + direction * enter;
  int x = std::clamp(static_cast<int>(p.x() / cell_m_), 0, columns_ - 1);
  int y = std::clamp(static_cast<int>(p.y() / cell_m_), 0, rows_ - 1);
  const int step_x = direction.x() > 0 ? 1 : -1, step_y = direction.y() > 0 ? 1 : -1;
  const auto boundary = [&](int cell, int step, double from, double slope) {
    return slope == 0.0 ? kNothingHit : ((cell + (step > 0 ? 1 : 0)) * cell_m_ - from) / slope;
  };
  while (x >= 0 && x < columns_ && y >= 0 && y < rows_) {
    const double to_x = boundary(x, step_x, origin.x(), direction.x());
    const double to_y = boundary(y, step_y, origin.y(), direction.y());
    const double end = std::min(to_x, to_y);
    const double hit = CastInCell(static_cast<std::size_t>(y) * columns_ + x, origin_map, direction);
    // A hit beyond this cell may be hidden by a segment of a cell between: it is found again there.
    if (hit <= end + 1e-9) return hit <= max_m ? hit : kNothingHit;
    if (end > leave) return kNothingHit;
    if (to_x < to_y) {
      x += step_x;
    } else {
      y += step_y;
    }
  }
  return kNothingHit;
}

double CastAtDisc(const Disc& disc, const Eigen::Vector2d& origin_map, const Eigen::Vector2d& direction) {
  const Eigen::Vector2d to_center = disc.center_map - origin_map;
  const double rim2 = to_center.squaredNorm() - disc.radius_m * disc.radius_m;
  const double along = to_center.dot(direction);
  if (rim2 <= 0.0 || along <= 0.0) return kNothingHit;
  const double inside2 = along * along - rim2;
  if (inside2 < 0.0) return kNothingHit;
  return rim2 / (along + std::sqrt(inside2));  // The smaller root, without the difference of near equals.
}

}  // namespace cairn::sim
