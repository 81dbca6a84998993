// Lines joined to what they are parts of: collinear pieces with near ends become one line, lines whose ends meet become
// a chain (polyline), and short lines that belong to nothing are dropped. Not the extraction: works on what
// ExtractLines found, and merges across pieces that extraction keeps apart because the sweep saw something between.
// Lines in the robot frame of their scan, in sweep order, which is kept. Stateless, thread-safe, deterministic.
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
  double collinear_rad = Radians(3.0);  // Slopes of pieces of one line differ by less ...
  double collinear_m = 0.04;            // ... the ends of each lie this near the other ...
  double gap_m = 0.4;                   // ... and their facing ends this near each other. Larger: doors are closed.
  double joint_m = 0.25;                // Ends this near belong to one chain.
  double stub_m = 0.25;                 // Shorter lines outside every chain are dropped.
};
void Visit(OptionVisitor& visitor, PolylineOptions& options);

struct Polyline {
  std::vector<int> lines;                 // Indices, in sweep order.
  std::vector<Eigen::Vector2d> vertices;  // Ends and joints: one more than lines.
  bool closed = false;                    // The last line meets the first: the last vertex is the first again.
};

// Both as one line, where they are pieces of one.
[[nodiscard]] std::optional<LineFeature> JoinCollinear(const LineFeature& a, const LineFeature& b,
                                                       const PolylineOptions& options);

[[nodiscard]] std::vector<LineFeature> MergeCollinear(std::vector<LineFeature> lines, const PolylineOptions& options);

// Every line is in exactly one; a line that meets no other is a polyline by itself.
[[nodiscard]] std::vector<Polyline> PolylinesOf(std::span<const LineFeature> lines, const PolylineOptions& options);

// All of the above: merged lines without stubs.
[[nodiscard]] std::vector<LineFeature> PolylineLines(std::span<const LineFeature> lines,
                                                     const PolylineOptions& options);

}  // namespace cairn::slam
