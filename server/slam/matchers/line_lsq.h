// Matches two scans by their lines: lines are paired by normals, midpoints and slopes, least squares over the
// pairs give the motion, and both steps are repeated until they agree. It is fast, because it uses no points,
// and about as exact as the lines are. Not a global search: the error of the prior must be below about half a
// metre and 15 degrees.
// Frames: features in the robot frames of their scans; returns T_ref_curr. Stateless, thread-safe,
// deterministic. Failures (the result is the prior): kTooFewFeatures, a scan without lines; kNoPairs;
// kInconsistent, the pairs make up too little of the current scan. In a corridor or with one wall the
// position along it comes from the prior, and the result is converged and degenerate.
// Source: thesis B 4.3, Figure 4.2, 5.4.3.
#pragma once

#include <vector>

#include "server/slam/matchers/line_association.h"
#include "server/slam/matchers/line_least_squares.h"
#include "server/slam/matchers/polyline.h"
#include "server/slam/matching/match_result.h"

namespace cairn::slam {

struct LineLsqOptions {
  PolylineOptions polylines;
  LineAssociationOptions association;
  LineLeastSquaresOptions least_squares;
  std::int64_t max_rounds = 50;  // Bound of thesis B 5.4.3.
  double min_score = 0.35;
};
void Visit(OptionVisitor& visitor, LineLsqOptions& options);

// The result with intermediate values, for studies.
struct LineLsqMatch {
  MatchResult result;
  std::vector<LinePair> pairs;  // Pairs of the last round: indices into PolylineLines of the scans.
  std::vector<double> errors;   // E of (5.5) per round: the remaining chi over the number of pairs.
};
[[nodiscard]] LineLsqMatch MatchLinesByLeastSquares(const ScanFeatures& ref, const ScanFeatures& curr,
                                                    const MatchPrior& prior, const LineLsqOptions& options);

[[nodiscard]] MatchResult MatchByLineLsq(const ScanFeatures& ref, const ScanFeatures& curr, const MatchPrior& prior,
                                         const LineLsqOptions& options);

}  // namespace cairn::slam
