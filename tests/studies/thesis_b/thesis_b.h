// The parts of `cairn-study thesis-b`. Thesis B is about fast position tracking by scan matching with lines (no earlier
// than 2011; the copy used here has no title page). Each part adds a section to the report, and reports figures that
// are not plausible.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/slam/features/line_feature.h"
#include "tests/studies/logs.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// 5.4.2, Table 5.1, Figures 5.7-5.14: the eight transforms recovered by least squares over known pairs; chi
// curves.
void StudyLeastSquares(StudyContext& context, const StudyLog& log);

// 5.4.3, Figures 5.15-5.18: two poses of a corridor, least squares alone and with association; rounds needed.
void StudyAssociation(StudyContext& context);

// Consecutive scans of the available logs, with odometry as the guess, compared with point-to-line ICP.
void StudyTracking(StudyContext& context, const std::vector<StudyLog>& logs);

// 2.2.2: the place in a known map of lines from nothing, and followed with odometry, in the simulated worlds
// and on the logs at hand.
void StudyLineMatch(StudyContext& context);

// The lines as one series of a plot, the pen lifted between them; moved by T.
[[nodiscard]] Series LineSeries(std::span<const slam::LineFeature> lines, const Pose2& T, std::string label,
                                int colour);

}  // namespace cairn::studies
