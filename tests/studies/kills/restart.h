// The times of a server's restarts on the state of eight robots that drove for an hour each.
#pragma once

#include <cstdint>
#include <vector>

#include "tests/studies/study.h"

namespace cairn::studies {

struct RestartTimes {
  std::uintmax_t state_bytes = 0;
  // Of each restart, since the process was started.
  std::vector<double> tiles_s;  // Until tiles are answered.
  std::vector<double> poses_s;  // Until the pose of every robot is answered.
};

// The state is made once and kept in the study's output folder. Throws std::runtime_error where a program fails.
[[nodiscard]] RestartTimes MeasureRestarts(StudyContext& context);

}  // namespace cairn::studies
