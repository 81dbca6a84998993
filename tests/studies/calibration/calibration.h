// The parts of `cairn-study calibration`: what was put in beside what came out. Each adds its tables and plots to the
// report and answers whether its figures keep the bounds it states.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

[[nodiscard]] bool StudyUmbmark(StudyContext& context);       // Thesis B 3.3.
[[nodiscard]] bool StudyMotionModels(StudyContext& context);  // Thesis C 4.5.1, 5.2.
[[nodiscard]] bool StudyCloud(StudyContext& context);         // Thesis C 4.3, 5.4.

}  // namespace cairn::studies
