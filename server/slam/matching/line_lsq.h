// Matches two scans by their lines: lines are paired by normals, midpoints and slopes, least squares over the pairs
// give the motion, and both repeat until they agree. Fast (no points are touched) and about as exact as the lines are.
// Not a global search: the prior must be within about half a metre and 15 degrees. Frames: features in the robot frames
// of their scans; answers T_prev_curr. Stateless, thread-safe, deterministic. Failures (the answer is the prior):
// kTooFewFeatures, a scan without lines; kNoPairs; kInconsistent, the pairs make up too little of the current scan.
// Corridor or one wall: the place along it from the prior; converged and degenerate. Source: thesis B 4.3,
// Figure 4.2, 5.4.3.
#pragma once

#include <vector>

#include "server/slam/features/polyline.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/line_association.h"
#include "server/slam/matching/line_least_squares.h"
#include "server/slam/matching/match_prior.h"

namespace cairn::slam {

struct LineLsqOptions {
  PolylineOptions polylines;
  LineAssociationOptions association;
  LineLeastSquaresOptions least_squares;
  std::int64_t max_rounds = 50;    // Of association and least squares (5.4.3); typical: 8.
  double min_score = 0.35;         // Share of the current scan's line length that found its wall.
  double degenerate_ratio = 0.02;  // Weakest over strongest hold on translation below which it is a corridor.
  double sigma_floor_m = 0.004;    // What a line's place is never better known than ...
  double slope_sigma_floor_rad = Radians(0.15);  // ... and its slope.
};
void Visit(OptionVisitor& visitor, LineLsqOptions& options);

// With what happened on the way, for studies.
struct LineLsqMatch {
  MatchResult result;
  std::vector<LinePair> pairs;  // Of the last round; indices into PolylineLines of the scans.
  std::vector<double> errors;   // E of (5.5) per round: chi left over the number of pairs.
};
[[nodiscard]] LineLsqMatch MatchLinesByLeastSquares(const ScanFeatures& prev, const ScanFeatures& curr,
                                                    const MatchPrior& prior, const LineLsqOptions& options);

[[nodiscard]] MatchResult MatchByLineLsq(const ScanFeatures& prev, const ScanFeatures& curr, const MatchPrior& prior,
                                         const LineLsqOptions& options);

}  // namespace cairn::slam
