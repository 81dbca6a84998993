// The part `capacity` of the study `fleet`.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

// How many robots a server on one core carries.
void StudyCapacity(StudyContext& context);

}  // namespace cairn::studies
