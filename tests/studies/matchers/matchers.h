// The parts of `cairn-study matchers`. Each adds its section to the report, and tells it where a figure is
// not plausible.
#pragma once

#include <vector>

#include "server/slam/methods.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// Time, bias and spread from a guess as good as odometry's, over the shipped worlds and several noises.
void StudyExactness(StudyContext& context, const std::vector<slam::MatcherKind>& kinds);

// Corridor, one wall, an empty scan, 90 to 360 degrees of view, half of the beams on moving things.
void StudySpecialCases(StudyContext& context, const std::vector<slam::MatcherKind>& kinds);

// Share of right answers over the initial error in translation and rotation, as a heat map for each matcher.
void StudyBasins(StudyContext& context, const std::vector<slam::MatcherKind>& kinds);

}  // namespace cairn::studies
