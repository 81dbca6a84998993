// The parts of `cairn-study matchers`. Each adds its section to the report and returns whether its figures are
// plausible.
#pragma once

#include <vector>

#include "server/slam/matching/scan_matching.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// Time, bias and spread from a guess as good as odometry's, over the shipped worlds and several noises.
[[nodiscard]] bool StudyExactness(StudyContext& context, const std::vector<slam::MatcherKind>& kinds);

// Corridor, one wall, an empty scan, 90 to 360 degrees of view, half of the beams on moving things.
[[nodiscard]] bool StudySpecialCases(StudyContext& context, const std::vector<slam::MatcherKind>& kinds);

// Share of right answers over the initial error in translation and rotation, as a heat map for each matcher.
[[nodiscard]] bool StudyBasins(StudyContext& context, const std::vector<slam::MatcherKind>& kinds);

}  // namespace cairn::studies
