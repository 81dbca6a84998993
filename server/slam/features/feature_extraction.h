// Extracts all features of one scan that matchers and filters use, in one call: lines, corners, patterns.
// Robot frame. Stateless, thread-safe, deterministic. Precondition: the scan passed ValidateScan.
// Source: thesis A 3.3, 3.4.
#pragma once

#include "common/options/option_visitor.h"
#include "server/slam/features/corners.h"
#include "server/slam/features/line_extraction.h"

namespace cairn::slam {

struct FeatureOptions {
  LineOptions lines;
  CornerOptions corners;
};
void Visit(OptionVisitor& visitor, FeatureOptions& options);

[[nodiscard]] ScanFeatures ExtractFeatures(const Scan& scan, const FeatureOptions& options);

// The same for given points of the scan, which may be thinned or deskewed.
[[nodiscard]] ScanFeatures ExtractFeatures(std::span<const BeamPoint> points, const Scan& scan,
                                           const FeatureOptions& options);

}  // namespace cairn::slam
