// The part of the study of furniture about doors.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyDoors(StudyContext& context);

}  // namespace cairn::studies
