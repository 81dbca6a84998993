#include "common/map/map_edit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string>

#include "common/code_points.h"
#include "common/options/number_text.h"

namespace cairn {
namespace {

constexpr double kFarthest_m = 10000.0;
constexpr double kThinnestLine_m = 0.01, kWidestLine_m = 10.0;
constexpr double kSmallestArea_m2 = 1e-4;

using Points = std::span<const Eigen::Vector2d>;

tl::unexpected<Status> Invalid(const std::string& why) {
  return Fail(StatusCode::kInvalidArgument, "the edit: " + why);
}

// In square metres.
double Surface(Points corners) {
  double twice = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    // From the first corner on, because far from the origin the products would be rounded.
    const Eigen::Vector2d a = corners[i] - corners[0], b = corners[(i + 1) % corners.size()] - corners[0];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return 0.5 * std::abs(twice);
}

// Well-formed UTF-8 (RFC 3629) without control characters, which could do anything in the terminal of somebody else.
bool IsPrintable(std::string_view text) {
  while (!text.empty()) {
    const CodePoint first = FirstCodePoint(text);
    if (first.bytes == 0 || IsControl(first.value)) return false;
    text.remove_prefix(first.bytes);
  }
  return true;
}

// Rows of cells whose centres are between two heights, and in a row those between two places.
class Raster {
 public:
  Raster(double resolution_m, std::vector<CellRun>& runs) : resolution_m_(resolution_m), runs_(runs) {}

  // The area whose corners these are; where its edges cross each other, what lies inside an odd number of times.
  void Fill(Points corners) {
    const auto [low, high] = std::ranges::minmax(corners, {}, [](const auto& corner) { return corner.y(); });
    std::vector<double> crossings_m;
    for (int row = FirstFrom(low.y()); CentreOf(row) <= high.y(); ++row) {
      const double y_m = CentreOf(row);
      crossings_m.clear();
      for (std::size_t i = 0; i < corners.size(); ++i) {
        const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
        if ((a.y() <= y_m) != (b.y() <= y_m))
          crossings_m.push_back(a.x() + (y_m - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
      }
      std::ranges::sort(crossings_m);
      for (std::size_t i = 0; i + 1 < crossings_m.size(); i += 2) Add(row, crossings_m[i], crossings_m[i + 1]);
    }
  }

  void FillDisc(const Eigen::Vector2d& centre, double radius_m) {
    for (int row = FirstFrom(centre.y() - radius_m); CentreOf(row) <= centre.y() + radius_m; ++row) {
      const double away_m = CentreOf(row) - centre.y();
      const double half_m = std::sqrt(std::max(0.0, radius_m * radius_m - away_m * away_m));
      Add(row, centre.x() - half_m, centre.x() + half_m);
    }
  }

 private:
  [[nodiscard]] double CentreOf(int row) const { return (row + 0.5) * resolution_m_; }
  // The first cell whose centre is not before this place.
  [[nodiscard]] int FirstFrom(double place_m) const {
    return static_cast<int>(std::ceil(place_m / resolution_m_ - 0.5));
  }
  void Add(int row, double from_m, double to_m) {
    const int first = FirstFrom(from_m), last = FirstFrom(to_m) - 1;
    if (first <= last) runs_.push_back({row, first, last});
  }

  const double resolution_m_;
  std::vector<CellRun>& runs_;
};

}  // namespace

std::string_view MapEditKindName(MapEditKind kind) {
  static constexpr std::array<std::string_view, kMapEditKindCount> kNames = {"free", "unknown", "occupied", "keep_out",
                                                                             "origin"};
  const auto index = static_cast<std::size_t>(kind);
  return index < kNames.size() ? kNames[index] : "unknown kind";
}

Result<void> ValidateMapEdit(const MapEdit& edit) {
  if (static_cast<int>(edit.kind) >= kMapEditKindCount) return Invalid("its kind is not known");
  const bool is_line = edit.width_m != 0.0, is_origin = edit.kind == MapEditKind::kOrigin;
  if (is_origin && (is_line || edit.points_map.size() != 2))
    return Invalid("an origin has two points and no width: where it is, and a point on the x axis");
  if (is_line && !(edit.width_m >= kThinnestLine_m && edit.width_m <= kWidestLine_m)) {
    return Invalid("a line is " + ExactText(kThinnestLine_m) + " to " + ExactText(kWidestLine_m) + " m wide");
  }
  const std::size_t fewest = is_line || is_origin ? 2 : 3;
  if (edit.points_map.size() < fewest || edit.points_map.size() > kMostEditPoints) {
    return Invalid((is_line ? "a line has " : "an area has ") + std::to_string(fewest) + " to " +
                   std::to_string(kMostEditPoints) + " points, not " + std::to_string(edit.points_map.size()));
  }
  constexpr double kRounding_m = 1e-6, kRounding_m2 = 1e-6;  // An edit that is moved stays valid.
  for (const Eigen::Vector2d& point : edit.points_map) {
    if (!point.allFinite() || point.norm() > kFarthest_m)
      return Invalid("its points must be within " + ExactText(kFarthest_m) + " m of the map's origin");
    if ((point - edit.points_map.front()).norm() > kFarthestInEdit_m + kRounding_m)
      return Invalid("a point is more than " + ExactText(kFarthestInEdit_m) + " m from the first one; divide it");
  }
  if (is_origin && (edit.points_map[1] - edit.points_map[0]).norm() < kThinnestLine_m - kRounding_m)
    return Invalid("the two points of an origin are at one place");
  if (!is_line && !is_origin && Surface(edit.points_map) < kSmallestArea_m2 - kRounding_m2)
    return Invalid("its corners enclose nothing; give a width if it is a line");
  if (edit.note.size() > kMostEditNoteBytes)
    return Invalid("its note has more than " + std::to_string(kMostEditNoteBytes) + " bytes");
  if (!IsPrintable(edit.note)) return Invalid("its note is not UTF-8, or holds control characters");
  return {};
}

MapEdit Moved(const MapEdit& edit, const Pose2& T_into_from) {
  MapEdit moved = edit;
  for (Eigen::Vector2d& point : moved.points_map) point = T_into_from * point;
  return moved;
}

std::vector<CellRun> CellsOf(const MapEdit& edit, double resolution_m) {
  std::vector<CellRun> runs;
  Raster raster(resolution_m, runs);
  const std::vector<Eigen::Vector2d>& points = edit.points_map;
  if (edit.width_m == 0.0) {
    raster.Fill(points);
    return runs;
  }
  const double half_m = std::max(0.5 * edit.width_m, 0.5 * std::numbers::sqrt2 * resolution_m);
  for (std::size_t i = 0; i < points.size(); ++i) {
    raster.FillDisc(points[i], half_m);
    if (i == 0 || points[i] == points[i - 1]) continue;
    const Eigen::Vector2d &a = points[i - 1], &b = points[i];
    const Eigen::Vector2d along = (b - a).normalized();
    const Eigen::Vector2d aside = half_m * Eigen::Vector2d(-along.y(), along.x());
    raster.Fill(std::array<Eigen::Vector2d, 4>{a + aside, b + aside, b - aside, a - aside});
  }
  return runs;
}

}  // namespace cairn
