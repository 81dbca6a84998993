// The part `seeds` of the study `systems`.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

// How much of the accuracy of the default configuration is luck: every log with five seeds of the filter.
void StudySeeds(StudyContext& context);

}  // namespace cairn::studies
