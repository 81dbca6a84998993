// The parts of `cairn-study thesis-a`, in the order of thesis A (feature-based scan matching with FastSLAM).
// Each adds its section to the report, and tells it where a figure is not plausible.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/studies/logs.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// What makes the estimator the thesis' own: the voting matcher's answer is the step, no refinement, no
// revisits, no large loops; landmarks are all a filter sees. Assignments for MapperWith.
[[nodiscard]] std::vector<std::string> LinesOnly();

// What the study holds a published log to, in metres of mean relation error: about half as much again as is
// measured on the whole log.
struct AccuracyLimits {
  double shipped_m = 0.0;     // The mapper as it is shipped, any number of particles from 50 on.
  double lines_only_m = 0.0;  // LinesOnly(), at 180 degrees of view.
};
// Nothing for logs that were never measured; the first scans of a log are held to the limits of the whole.
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
