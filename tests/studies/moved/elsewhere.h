// cairn-study moved --only elsewhere: robots that somebody has carried to a part of the site that they have not mapped,
// but another robot has. How many find themselves in their own map, how many does the search over the map of the site
// find, which a job makes ten seconds after they were lost and again after twice that time, and is any localized at a
// wrong place?
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyElsewhere(StudyContext& context);

}  // namespace cairn::studies
