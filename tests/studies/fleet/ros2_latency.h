// The time from scan to pose of the same simulated robots through both doors of a live server: the native one, and that
// for ROS 2.
#pragma once

#include "tests/studies/study.h"

namespace cairn::studies {

void StudyRos2Latency(StudyContext& context);

}  // namespace cairn::studies
