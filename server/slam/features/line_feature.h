// The features that are extracted from one scan: lines with the class of their ends, corners between lines,
// and patterns of lines and corners. All are in the `robot` frame of that scan, in metres and radians. Plain
// values.
// Lines are ordered anticlockwise as seen from the laser, whichever way the scanner turns, so that the signs
// of angles mean the same for every scanner. In a full-turn scan the last line is followed by the first.
// Source: thesis A (feature-based scan matching with FastSLAM), 3.4.1-3.4.3.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace cairn::slam {

// Which ends of a line are true ends, in contrast to ends where the view was blocked or the scan ended (3-10,
// 3-11). "Right" is the end that an anticlockwise sweep reaches first.
enum class EndClass : std::uint8_t { kOpen = 0, kLeftEnded, kRightEnded, kBothEnded };

struct LineFeature {
  Eigen::Vector2d first = Eigen::Vector2d::Zero();  // Right end: the first point, projected on the line.
  Eigen::Vector2d last = Eigen::Vector2d::Zero();   // Left end: the last point, projected on the line.
  double normal_angle = 0.0;                        // alpha in x cos(alpha) + y sin(alpha) = r, (-pi, pi].
  double distance = 0.0;                            // r >= 0: distance of the line from the robot's origin.
  double slope = 0.0;                               // Direction from first to last, (-pi, pi].
  double length = 0.0;
  double deviation = 0.0;  // Root mean square distance of the points from the line (3-12).
  int first_beam = 0;      // Index of the beam at the right end.
  // Index of the beam at the left end; below first_beam for a clockwise scanner and across the seam.
  int last_beam = 0;
  int point_count = 0;
  EndClass ends = EndClass::kOpen;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.first, self.last, self.normal_angle, self.distance, self.slope, self.length, self.deviation,
            self.first_beam, self.last_beam, self.point_count, self.ends);
    archive.Require(self.ends <= EndClass::kBothEnded, "the ends of a line");
  }

  [[nodiscard]] Eigen::Vector2d midpoint() const { return 0.5 * (first + last); }
  [[nodiscard]] Eigen::Vector2d direction() const { return (last - first) / std::max(length, 1e-9); }
  // Unit normal on the left of the direction; the laser sees the line from this side.
  [[nodiscard]] Eigen::Vector2d left_normal() const {
    const Eigen::Vector2d along = direction();
    return {-along.y(), along.x()};
  }
  // Signed distance of a point from the infinite line, positive on the left of the direction.
  [[nodiscard]] double OffsetOf(const Eigen::Vector2d& p_robot) const { return left_normal().dot(p_robot - first); }
};

struct CornerFeature {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  bool real = false;  // True: two consecutive lines meet here. False: only their extensions do.
  // From the slope of line_a to that of line_b, (-pi, pi]: > 0 in an inside corner of a room (concave), < 0
  // at an edge that stands out (convex).
  double angle = 0.0;
  bool long_lines = false;  // Both lines count as long (3.4.2, category 1).
  // Indices into ScanFeatures::lines. line_a < line_b, except for the real corner across the seam of a
  // full-turn scan.
  int line_a = 0;
  int line_b = 0;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.position, self.real, self.angle, self.long_lines, self.line_a, self.line_b);
  }
};

// A pattern compares a line with this many following lines. An entry is NaN if its line or corner does not
// exist.
inline constexpr int kPatternSize = 5;
struct LinePattern {
  // Slope of this line minus that of the five following lines, wrapped (Table 3.1).
  std::array<double, kPatternSize> angle{};
  // Distance from this line's corner to those of the five following lines (Table 3.2).
  std::array<double, kPatternSize> corner_distance{};
  int count = 0;  // Number of the five following lines that exist.
  // Index of the line with which this line forms its corner: the first following line that is not parallel to
  // it; -1 if there is none.
  int corner_with = -1;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.angle, self.corner_distance, self.count, self.corner_with);
  }
};

struct ScanFeatures {
  std::vector<LineFeature> lines;
  std::vector<CornerFeature> corners;
  std::vector<LinePattern> patterns;  // One per line.
  double angle_step_rad = 0.0;        // Angle between beams, > 0; limits how exactly ends of lines are seen.
  bool full_turn = false;             // The last line is followed by the first.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.lines, self.corners, self.patterns, self.angle_step_rad, self.full_turn);
    const auto lines = static_cast<int>(self.lines.size());
    bool sound = self.patterns.size() == self.lines.size();
    for (const CornerFeature& c : self.corners)
      sound = sound && 0 <= c.line_a && c.line_a < lines && 0 <= c.line_b && c.line_b < lines;
    for (const LinePattern& p : self.patterns)
      sound = sound && 0 <= p.count && p.count <= kPatternSize && -1 <= p.corner_with && p.corner_with < lines;
    archive.Require(sound, "the features of a scan");
  }
};

}  // namespace cairn::slam
