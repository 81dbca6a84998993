#include "server/slam/features/feature_extraction.h"

#include <cmath>

#include "server/slam/features/corners.h"

namespace cairn::slam {

ScanFeatures ExtractFeatures(const Scan& scan, const FeatureOptions& options) {
  return ExtractFeatures(PointsOf(scan), scan, options);
}

ScanFeatures ExtractFeatures(std::span<const BeamPoint> points, const Scan& scan, const FeatureOptions& options) {
  ScanFeatures features;
  features.angle_step_rad = std::abs(scan.angle_step_rad);
  features.full_turn = IsFullTurn(scan);
  features.lines = ExtractLines(points, scan, options.lines);
  features.corners = ExtractCorners(features, options.corners);
  features.patterns = PatternsOf(features.lines, features.full_turn, options.corners.min_angle_rad);
  return features;
}

void Visit(OptionVisitor& visitor, FeatureOptions& options) {
  visitor.Section("lines", "Extraction of lines by split and merge.", [&] { Visit(visitor, options.lines); });
  visitor.Section("corners", "Corners between lines.", [&] { Visit(visitor, options.corners); });
}

}  // namespace cairn::slam
