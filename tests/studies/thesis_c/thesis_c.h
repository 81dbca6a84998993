// The parts of `cairn-study thesis-c`, in the order of chapter 5 of thesis C: Luis Ernesto Ynoquio Herrera, "Mobile
// Robot Simultaneous Localization and Mapping Using DP-SLAM with a Single Laser Range Finder", PUC-Rio, 2011. Each part
// adds a section to the report, and reports figures that are not plausible.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

// 5.1.1, Figures 5.1-5.4: population and generations. In addition the ten strategies; the thesis suggests to choose one
// by trial (2.4.6).
void StudyEvolution(StudyContext& context);

// 5.1.2, Figures 5.5-5.9: noise of the ranges, the error that accumulates; 5.2, Figure 5.19: how errors are
// distributed.
void StudyRangeNoise(StudyContext& context);

// 5.1.3, Figures 5.10-5.18: fitness along real logs, its peaks, and maps without odometry.
void StudyFitness(StudyContext& context);

// 5.3, Figures 5.24-5.28: DP-SLAM fed with scan-matched steps instead of odometry, its error over the way.
void StudyDpSlamWithoutOdometry(StudyContext& context);

// From which initial errors Newton's method (2.3.3) finds the answer, with and without the coarse optimisation before
// it, compared with the evolution.
void StudyNewtonBasin(StudyContext& context);

}  // namespace cairn::studies
