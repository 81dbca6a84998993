// The interface of a scan matcher: a function that compares two scans, and two properties of the method
// behind it. The method is chosen where the ScanMatcher is made (methods.h), and its options are stored
// inside.
// Frames: `ref` and `curr` are in the robot frames of their scans; the prior and the result are T_ref_curr. A
// matcher that does not converge returns the prior with its covariance and the kind of failure. The function
// has no state and may be called from any thread; its result does not depend on how `parallel_for` divides
// the work.
#pragma once

#include <functional>

#include "server/slam/features/scan_view.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct ScanMatcher {
  std::function<MatchResult(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                            const ParallelFor& parallel_for)>
      match;
  // True if the method searches so far around the prior that another start finds nothing new.
  bool searches_wide = false;
  // True if the method is as exact from a metre away as from nearby. A reference that still explains the scan
  // is then kept, because each change of the reference adds an error. It is false for lines and cells, which
  // change too much with the place from which they are seen.
  bool keeps_reference = false;
};

}  // namespace cairn::slam
