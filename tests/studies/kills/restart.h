// The times of a server's restarts on the state of eight robots that have driven for an hour each, and go on driving.
#pragma once

#include <cstdint>
#include <vector>

#include "tests/studies/study.h"

namespace cairn::studies {

struct RestartTimes {
  std::uintmax_t state_bytes = 0;
  // Of each restart, since the process was started.
  std::vector<double> tiles_s;  // Until tiles are answered.
  std::vector<double> poses_s;  // Until the last pose of every robot, which is of before the kill, is answered.
  // Until every robot, which is connected all the time, has a pose of a scan that it made after the kill.
  std::vector<double> new_poses_s;
  int new_sessions = 0;  // That robots had to open because the server did not know the one before.
};

// The state is made once and kept in the study's output folder; the servers work on a copy. Throws std::runtime_error
// where a program fails.
[[nodiscard]] RestartTimes MeasureRestarts(StudyContext& context);

}  // namespace cairn::studies
