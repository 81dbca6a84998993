// Matches two scans by point-to-line ICP: the points of the current scan are moved until they lie on the surfaces of
// the previous one, from a guess that takes part as a prior. The same alignment that refines the front-end's poses
// against many keyframes (point_to_line.h), scan to scan. Not a global search: needs an initial error below about 0.5
// m, 20 deg. Frames: points in the robot frames of their scans; answers T_prev_curr. Stateless, thread-safe,
// deterministic. Failures (the answer is the prior): kTooFewFeatures, a scan with hardly any points; kNotConverged.
// Source: Censi, ICRA 2008.
#pragma once

#include "server/slam/matching/match_prior.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/matching/scan_view.h"

namespace cairn::slam {

[[nodiscard]] MatchResult MatchByIcp(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                                     const PointToLineOptions& options);

}  // namespace cairn::slam
