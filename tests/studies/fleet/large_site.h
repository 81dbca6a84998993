// Who comes late to a site of 10,000 tiles: how long the whole map takes to arrive, and how long the first picture of
// it.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyLargeSite(StudyContext& context);

}  // namespace cairn::studies
