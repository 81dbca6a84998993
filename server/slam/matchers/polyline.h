// Joins the lines of one scan: collinear pieces with near ends become one line, lines whose ends meet become
// a chain (polyline), and short lines that are connected to nothing are dropped. Not the extraction: it works
// on the result of ExtractLines and also merges pieces that extraction separates because something stands
// between them.
// Lines in the robot frame of their scan; their sweep order is kept. Stateless, thread-safe, deterministic.
// Source: thesis B 3.4.1 (mergeCollinearLines) and 4.2 (polyline structure).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"

namespace cairn::slam {

struct PolylineOptions {
  double collinear_rad = Radians(3.0);
  double collinear_m = 0.04;
  double gap_m = 0.4;
  double joint_m = 0.25;
  double stub_m = 0.25;
};
void Visit(OptionVisitor& visitor, PolylineOptions& options);

struct Polyline {
  std::vector<int> lines;                 // Indices of the lines, in sweep order.
  std::vector<Eigen::Vector2d> vertices;  // Ends and joints, one more than there are lines.
  // True if the last line meets the first; the last vertex equals the first.
  bool closed = false;
};

// Returns both as one line if they are pieces of one.
[[nodiscard]] std::optional<LineFeature> JoinCollinear(const LineFeature& a, const LineFeature& b,
                                                       const PolylineOptions& options);

[[nodiscard]] std::vector<LineFeature> MergeCollinear(std::vector<LineFeature> lines, const PolylineOptions& options);

// Every line is in exactly one polyline; a line that meets no other is a polyline by itself.
[[nodiscard]] std::vector<Polyline> PolylinesOf(std::span<const LineFeature> lines, const PolylineOptions& options);

// All steps in turn: merged lines without short unconnected ones.
[[nodiscard]] std::vector<LineFeature> PolylineLines(std::span<const LineFeature> lines,
                                                     const PolylineOptions& options);

}  // namespace cairn::slam
