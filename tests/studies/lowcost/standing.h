// `cairn-study lowcost --only standing`: robots with noisy lidars that stand for an hour.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void RunStanding(StudyContext& context);

}  // namespace cairn::studies
