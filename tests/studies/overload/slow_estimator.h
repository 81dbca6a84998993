// A part of cairn-study overload: the estimators are too slow for what the robots send.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudySlowEstimator(StudyContext& context);

}  // namespace cairn::studies
