#include "common/map/building_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

namespace cairn {
namespace {

constexpr std::uint8_t kOccupiedFrom = 65;  // As map_server's `occupied_thresh`.

// Unknown where the point is not on the image.
std::uint8_t CellAt(const OccupancyImage& map, const Eigen::Vector2d& p_cells) {
  const double column = std::floor(p_cells.x()), row = std::floor(p_cells.y());
  if (column < 0.0 || row < 0.0 || column >= map.width || row >= map.height) return kUnknownCell;
  return map
      .cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(column)];
}

// The centres of the occupied cells, in cells.
std::vector<Eigen::Vector2d> OccupiedOf(const OccupancyImage& map) {
  std::vector<Eigen::Vector2d> points;
  for (int row = 0; row < map.height; ++row) {
    for (int column = 0; column < map.width; ++column) {
      const std::size_t i =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(column);
      if (map.cells[i] != kUnknownCell && map.cells[i] >= kOccupiedFrom) points.emplace_back(column + 0.5, row + 0.5);
    }
  }
  return points;
}

// How much the points gather in rows and columns where the axes are turned by this angle: the sum of squares of the
// numbers of points in strips one cell wide. Walls along an axis fall into few strips.
double GatheringAt(const std::vector<Eigen::Vector2d>& points, double turned_rad) {
  const Eigen::Vector2d along(std::cos(turned_rad), std::sin(turned_rad)), across(-along.y(), along.x());
  double sum = 0.0;
  std::vector<double> strips;
  for (const Eigen::Vector2d& axis : {along, across}) {
    double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();
    for (const Eigen::Vector2d& point : points) {
      low = std::min(low, axis.dot(point));
      high = std::max(high, axis.dot(point));
    }
    strips.assign(static_cast<std::size_t>(high - low) + 2, 0.0);
    for (const Eigen::Vector2d& point : points) {
      // Each point counts in two strips by its distance, so that the sum changes smoothly with the angle.
      const double place = axis.dot(point) - low;
      const auto strip = static_cast<std::size_t>(place);
      strips[strip] += 1.0 - (place - static_cast<double>(strip));
      strips[strip + 1] += place - static_cast<double>(strip);
    }
    for (const double count : strips) sum += count * count;
  }
  return sum;
}

// By how much more the axes have to be turned, as the walls along them say: the common slope of lines through the
// points of each wall. A wall is what lies in neighbouring strips that are well filled.
double SlopeOfWalls(const std::vector<Eigen::Vector2d>& points, double turned_rad) {
  constexpr double kWellFilled = 0.2;  // Of the fullest strip.
  const Eigen::Vector2d along(std::cos(turned_rad), std::sin(turned_rad)), across(-along.y(), along.x());
  double covariance = 0.0, variance = 0.0;
  for (const auto& [axis, offset] : {std::pair(along, across), std::pair(across, Eigen::Vector2d(-along))}) {
    std::map<int, std::vector<Eigen::Vector2d>> strips;  // Coordinates (along the wall, across it).
    for (const Eigen::Vector2d& point : points) {
      const Eigen::Vector2d in_axes(axis.dot(point), offset.dot(point));
      strips[static_cast<int>(std::floor(in_axes.y()))].push_back(in_axes);
    }
    std::size_t fullest = 0;
    for (const auto& [place, in_strip] : strips) fullest = std::max(fullest, in_strip.size());
    std::vector<Eigen::Vector2d> wall;
    std::optional<int> last;
    const auto close = [&] {
      Eigen::Vector2d mean = Eigen::Vector2d::Zero();
      for (const Eigen::Vector2d& point : wall) mean += point / static_cast<double>(wall.size());
      for (const Eigen::Vector2d& point : wall) {
        covariance += (point.x() - mean.x()) * (point.y() - mean.y());
        variance += (point.x() - mean.x()) * (point.x() - mean.x());
      }
      wall.clear();
    };
    for (const auto& [place, in_strip] : strips) {
      if (static_cast<double>(in_strip.size()) < kWellFilled * static_cast<double>(fullest)) continue;
      if (last && place != *last + 1) close();
      wall.insert(wall.end(), in_strip.begin(), in_strip.end());
      last = place;
    }
    close();
  }
  return variance > 0.0 ? std::atan(covariance / variance) : 0.0;
}

}  // namespace

std::optional<Pose2> BuildingFrameOf(const std::vector<MapEdit>& edits) {
  const auto last = std::find_if(edits.rbegin(), edits.rend(), [](const MapEdit& edit) {
    return edit.kind == MapEditKind::kOrigin && edit.points_map.size() == 2;
  });
  if (last == edits.rend()) return std::nullopt;
  const Eigen::Vector2d origin = last->points_map[0], axis = last->points_map[1] - origin;
  return Pose2{origin.x(), origin.y(), std::atan2(axis.y(), axis.x())};
}

OccupancyImage InFrame(const OccupancyImage& map, const Pose2& T_map_frame) {
  OccupancyImage turned = map;
  const Pose2 T_frame_origin = Between(T_map_frame, map.T_map_origin);
  turned.T_map_origin = T_frame_origin;
  constexpr double kParallel_rad = 1e-9;
  if (std::abs(T_frame_origin.theta) < kParallel_rad || map.width <= 0 || map.height <= 0) {
    turned.T_map_origin.theta = 0.0;
    return turned;
  }
  const double cell_m = map.resolution_m;
  Eigen::Vector2d low = T_frame_origin.translation(), high = low;
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(map.width, 0), Eigen::Vector2d(map.width, map.height), Eigen::Vector2d(0, map.height)}) {
    const Eigen::Vector2d p_frame = T_frame_origin * Eigen::Vector2d(corner * cell_m);
    low = low.cwiseMin(p_frame);
    high = high.cwiseMax(p_frame);
  }
  // Cells of the new image lie on multiples of the resolution in the new frame.
  low = (low / cell_m).array().floor() * cell_m;
  turned.T_map_origin = {low.x(), low.y(), 0.0};
  turned.width = static_cast<int>(std::ceil((high.x() - low.x()) / cell_m));
  turned.height = static_cast<int>(std::ceil((high.y() - low.y()) / cell_m));
  turned.cells.assign(static_cast<std::size_t>(turned.width) * static_cast<std::size_t>(turned.height), kUnknownCell);
  const Pose2 T_origin_frame = T_frame_origin.Inverse();
  static constexpr std::array<std::array<double, 2>, 4> kQuarters = {
      {{0.25, 0.25}, {0.75, 0.25}, {0.25, 0.75}, {0.75, 0.75}}};
  for (int row = 0; row < turned.height; ++row) {
    for (int column = 0; column < turned.width; ++column) {
      const auto cell_at = [&](double x, double y) {
        const Eigen::Vector2d p_frame = low + cell_m * Eigen::Vector2d(column + x, row + y);
        return CellAt(map, Eigen::Vector2d((T_origin_frame * p_frame) / cell_m));
      };
      std::uint8_t cell = cell_at(0.5, 0.5);
      // A thin wall may miss the centres of a row of cells.
      for (const auto& [x, y] : kQuarters) {
        const std::uint8_t near = cell_at(x, y);
        if (near != kUnknownCell && near >= kOccupiedFrom && (cell == kUnknownCell || near > cell)) cell = near;
      }
      turned.cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(turned.width) +
                   static_cast<std::size_t>(column)] = cell;
    }
  }
  return turned;
}

Result<double> WallDirection(const OccupancyImage& map) {
  constexpr std::size_t kFewest = 100;
  constexpr double kQuarterTurn = std::numbers::pi / 2, kCoarse = kQuarterTurn / 180, kFine = kCoarse / 40;
  // By how much the best direction must be above the mean of all. Walls of one direction give 2 and more, a round
  // room 1.05.
  constexpr double kStandsOut = 1.2;
  const std::vector<Eigen::Vector2d> points = OccupiedOf(map);
  if (points.size() < kFewest)
    return Fail(StatusCode::kFailedPrecondition, "too little of the map is occupied to see a direction of walls");
  double best_rad = 0.0, most = -1.0, sum = 0.0;
  int count = 0;
  const auto look = [&](double from_rad, double to_rad, double step_rad) {
    for (double angle = from_rad; angle <= to_rad; angle += step_rad) {
      const double gathering = GatheringAt(points, angle);
      sum += gathering;
      ++count;
      if (gathering <= most) continue;
      most = gathering;
      best_rad = angle;
    }
  };
  look(-kQuarterTurn / 2 + kCoarse, kQuarterTurn / 2 + 0.5 * kCoarse, kCoarse);
  const double mean = sum / count;
  if (most < kStandsOut * mean)
    return Fail(StatusCode::kFailedPrecondition, "the walls of the map have no common direction");
  const double coarse_rad = best_rad;
  look(coarse_rad - kCoarse, coarse_rad + kCoarse, kFine);
  // Cells favour their own directions; the lines through the walls do not.
  for (int i = 0; i < 3; ++i) best_rad += std::clamp(SlopeOfWalls(points, best_rad), -kCoarse, kCoarse);
  if (best_rad <= -kQuarterTurn / 2) best_rad += kQuarterTurn;
  return best_rad > kQuarterTurn / 2 ? best_rad - kQuarterTurn : best_rad;
}

}  // namespace cairn
