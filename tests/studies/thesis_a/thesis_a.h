// The parts of `cairn-study thesis-a`, in the order of thesis A: Ayhan Özgür, "A Novel Mobile Robot Navigation Method
// Based on Combined Feature Based Scan Matching and FastSLAM Algorithm", Middle East Technical University, 2010. Each
// part adds a section to the report, and reports figures that are not plausible.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/studies/logs.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// Assignments for MapperWith that make the estimator that of the thesis: the answer of the voting matcher is the step,
// and the filter uses nothing but landmarks (no refinement, no revisits, no large loops).
[[nodiscard]] std::vector<std::string> LinesOnly();

// The largest mean relation error, in metres, that the study accepts on a published log: about 1.5 times the error that
// was measured on the whole log.
struct AccuracyLimits {
  double shipped_m = 0.0;     // The mapper as it is shipped, any number of particles from 50 on.
  double lines_only_m = 0.0;  // LinesOnly(), at 180 degrees of view.
};
// Returns nothing for a log that was never measured. The limits of a whole log also apply to its first scans alone.
[[nodiscard]] std::optional<AccuracyLimits> AccuracyLimitsOf(const StudyLog& log);

// 2.1.1, Table 2.1: true and false positives and the spread of r and alpha of extracted lines, on simulated
// scans.
void StudyLineExtraction(StudyContext& context);

// 3.5.12.2-3: rotation with and without outlier removal, translation by distance vectors beside corner
// points.
void StudyPoseFromPairs(StudyContext& context);

// 3.7: the ways to draw an occupancy grid, printed and ours, along a simulated robot's true path.
void StudyGridModels(StudyContext& context);

// 5.1-5.6, Tables 5.15-5.17, Figures 5.35-5.37: matching alone, with landmark correction, with FastSLAM in
// its two forms; time and error of each, online and full maps.
void StudySystems(StudyContext& context, const std::vector<StudyLog>& logs);

// 5.7.1, Table 5.18, Figures 5.44-5.46: 50 to 450 particles.
void StudyParticles(StudyContext& context, const std::vector<StudyLog>& logs);

// 5.7.2, Figures 5.47-5.50: 180 to 90 degrees of view.
void StudyFieldOfView(StudyContext& context, const std::vector<StudyLog>& logs);

}  // namespace cairn::studies
