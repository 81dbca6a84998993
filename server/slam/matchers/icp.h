// Matches two scans by point-to-line ICP: moves the points of the current scan onto the surfaces of the
// previous scan, starting at the prior, which also takes part as a measurement. It is the same alignment that
// refines the front-end's poses against many keyframes (point_to_line.h), here from scan to scan. Not a
// global search: the initial error must be below about 0.5 m and 20 deg.
// Frames: points in the robot frames of their scans; returns T_ref_curr. Stateless, thread-safe,
// deterministic. Failures (the result is the prior): kTooFewFeatures, a scan with hardly any points;
// kNotConverged.
// Source: Censi, ICRA 2008.
#pragma once

#include "server/slam/features/scan_view.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/point_to_line.h"

namespace cairn::slam {

[[nodiscard]] MatchResult MatchByIcp(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                                     const PointToLineOptions& options);

}  // namespace cairn::slam
