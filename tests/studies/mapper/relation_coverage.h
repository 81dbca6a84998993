// Tests, on logs with verified relations between poses, whether the estimator states the right uncertainty of one pose
// relative to another one. A relation counts as inside if its error lies in the 95 % region of the stated covariance
// plus that of the relation itself, which was measured with scans, too.
// Two statements are tested. Of the smoothed path: the joint uncertainty of its poses (path_errors.h). Online:
// every pose with its own covariance, as a reader of poses combines them who knows nothing of what two poses share; so
// for poses near to each other it can only be too large.
#pragma once

#include <cstddef>

#include "tests/studies/log_run.h"
#include "tests/studies/logs.h"

namespace cairn::studies {

// Standard deviations of a verified relation: of x and of y, and of the heading.
struct RelationNoise {
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
};
// How far the relations of a log disagree with the alignment of their two scans. That includes the error of the
// alignment, so it is an upper bound, and the shares inside are a little too large.
[[nodiscard]] RelationNoise RelationNoiseOf(const StudyLog& log);

struct RelationCoverage {
  std::size_t compared = 0;
  double inside = 0.0;         // Share of the relations in the 95 % region; 0.95 is right.
  double nees = 0.0;           // Mean; 3 is right.
  double nees_median = 0.0;    // 2.37 is right.
  double position_nees = 0.0;  // 2 is right.
  double heading_nees = 0.0;   // 1 is right.
};

[[nodiscard]] RelationCoverage CoverageOfSmoothed(const LogRun& run, const StudyLog& log, const RelationNoise& noise);
// Of what the front-end alone says: the steps between keyframes, one after the other, without any loop. Relations whose
// two scans are at most kStepsWithinM of way apart.
inline constexpr double kStepsWithinM = 30.0;
[[nodiscard]] RelationCoverage CoverageOfSteps(const LogRun& run, const StudyLog& log, const RelationNoise& noise);
[[nodiscard]] RelationCoverage CoverageOfOnline(const LogRun& run, const StudyLog& log, const RelationNoise& noise);

}  // namespace cairn::studies
