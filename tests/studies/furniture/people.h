// The part of the study of furniture about people who walk.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyPeople(StudyContext& context);

}  // namespace cairn::studies
