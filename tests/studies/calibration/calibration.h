// The parts of `cairn-study calibration`: they compare what was put in with what came out. Each part adds its
// tables and plots to the report, and reports a failure if a figure exceeds its stated bound.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyUmbmark(StudyContext& context);       // Thesis B 3.3.
void StudyMotionModels(StudyContext& context);  // Thesis C 4.5.1, 5.2.
void StudyCloud(StudyContext& context);         // Thesis C 4.3, 5.4.

}  // namespace cairn::studies
