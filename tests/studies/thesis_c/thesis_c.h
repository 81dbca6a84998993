// The parts of `cairn-study thesis-c`, in the order of thesis C, chapter 5. Each adds its section to the
// report, and tells it where a figure is not plausible.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

// 5.1.1, Figures 5.1-5.4: population and generations; and the ten strategies, among which the thesis leaves
// the choice to trial and error (2.4.6).
void StudyEvolution(StudyContext& context);

// 5.1.2, Figures 5.5-5.9: noise of the ranges, the error that accumulates; 5.2, Figure 5.19: how errors are
// distributed.
void StudyRangeNoise(StudyContext& context);

// 5.1.3, Figures 5.10-5.18: fitness along real logs, its peaks, and maps without odometry.
void StudyFitness(StudyContext& context);

// 5.3, Figures 5.24-5.28: DP-SLAM fed with scan-matched steps instead of odometry, its error over the way.
void StudyDpSlamWithoutOdometry(StudyContext& context);

// From how far off Newton's algorithm (2.3.3) comes home, with and without its coarse climb, beside the
// evolution.
void StudyNewtonBasin(StudyContext& context);

}  // namespace cairn::studies
