// The parts of `cairn-study calibration`: what was put in beside what came out. Each adds its tables and plots to the
// report, and tells it where a figure does not keep the bound it states.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyUmbmark(StudyContext& context);       // Thesis B 3.3.
void StudyMotionModels(StudyContext& context);  // Thesis C 4.5.1, 5.2.
void StudyCloud(StudyContext& context);         // Thesis C 4.3, 5.4.

}  // namespace cairn::studies
