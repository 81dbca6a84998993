// What split-and-merge extracts from one scan: lines with what is known of their ends, corners between them, and the
// patterns lines and corners form. All in the `robot` frame of that scan, metres and radians. Plain values.
// Lines are ordered anticlockwise as seen from the laser, whichever way the scanner turns, so that signs of angles mean
// the same for every scanner. In a full-turn scan the last line is followed by the first.
// Source: thesis A (feature-based scan matching with FastSLAM), 3.4.1-3.4.3.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace cairn::slam {

// Which ends of a line are true ends rather than where the view was blocked or the scan ended (3-10, 3-11).
// "Right" is the end an anticlockwise sweep meets first.
enum class EndClass : std::uint8_t { kOpen = 0, kLeftEnded, kRightEnded, kBothEnded };

struct LineFeature {
  Eigen::Vector2d first = Eigen::Vector2d::Zero();  // Right end: the first point, projected on the line.
  Eigen::Vector2d last = Eigen::Vector2d::Zero();   // Left end.
  double normal_angle = 0.0;                        // alpha of x cos(alpha) + y sin(alpha) = r, (-pi, pi].
  double distance = 0.0;                            // r >= 0 from the robot's origin.
  double slope = 0.0;                               // Direction from first to last, (-pi, pi].
  double length = 0.0;
  double deviation = 0.0;  // RMS distance of the points (3-12).
  int first_beam = 0;      // Beam ids of the two ends; first > last for a clockwise scanner and across the seam of a
  int last_beam = 0;       // full-turn scan.
  int point_count = 0;
  EndClass ends = EndClass::kOpen;

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
  bool real = false;        // Two following lines that meet; else the meeting point of their extensions.
  double angle = 0.0;       // From line a's slope to line b's, (-pi, pi]. > 0: the room's inside corner (concave),
                            // < 0: an edge that stands out (convex).
  bool long_lines = false;  // Both lines count as long (3.4.2, category 1).
  int line_a = 0;           // Indices into ScanFeatures::lines, a before b in the sweep: line_a < line_b but for the
  int line_b = 0;           // real corner across the seam of a full-turn scan.
};

// Blank entries are NaN: the line, or the corner, does not exist.
inline constexpr int kPatternSize = 5;
struct LinePattern {
  std::array<double, kPatternSize> angle{};            // Slope of this line minus that of the following five (Table
                                                       // 3.1), wrapped.
  std::array<double, kPatternSize> corner_distance{};  // From this line's corner to those of the following five
                                                       // (Table 3.2).
  int count = 0;                                       // How many of the five following lines exist.
  int corner_with = -1;  // The line this line's corner is with: the first following one not parallel to it; -1: none.
};

struct ScanFeatures {
  std::vector<LineFeature> lines;
  std::vector<CornerFeature> corners;
  std::vector<LinePattern> patterns;  // One per line.
  double angle_step_rad = 0.0;        // Between beams, > 0: how sharply ends are seen.
  bool full_turn = false;             // The last line is followed by the first.
};

}  // namespace cairn::slam
