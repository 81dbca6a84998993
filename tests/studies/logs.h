// The logs that a study runs on: published logs if they are available (the report warns if not), and
// simulated ones with the true path. They are kept in memory, because studies run over the same log many
// times.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/sim/fleet.h"
#include "common/sensor/lidar_timing.h"
#include "common/sensor/log_record.h"
#include "common/sensor/trajectory.h"
#include "tests/studies/relations.h"
#include "tests/studies/study.h"

namespace cairn::studies {

struct StudyLog {
  std::string name;  // "intel", "simulated building".
  std::vector<LogRecord> records;
  std::vector<Relation> relations;  // True motions between two stamps; empty where unknown.
  Trajectory truth;                 // Simulated logs only, in `map`.
  Pose2 T_map_robot_start;          // First pose of the truth; the identity if it is unknown.

  [[nodiscard]] std::size_t scans() const;
  [[nodiscard]] double seconds() const;  // From the first scan to the last.
};

// The published log NAME.clf or NAME.log with NAME.relations, at most `max_scans` (0: all) of its scans.
// `timing`: what is known of its lidar. If it is absent, the report contains a warning, and nothing is returned.
[[nodiscard]] std::optional<StudyLog> OpenRealLog(StudyContext& context, const std::string& name, int max_scans = 0,
                                                  const LidarTiming& timing = {});

// Reads a log by its path, and FILE.relations beside it if that exists. Errors are reported.
[[nodiscard]] std::optional<StudyLog> OpenLogFile(StudyContext& context, const std::filesystem::path& path,
                                                  int max_scans = 0, const LidarTiming& timing = {});

// One robot driving `seconds` through a shipped world or world file. Relations join poses about 1, 5 and 20 m
// of way apart. Throws std::invalid_argument on a world or options that are not valid: studies name their
// own.
[[nodiscard]] StudyLog SimulateLog(const std::string& world, double seconds, const sim::FleetOptions& options);
[[nodiscard]] StudyLog SimulateLog(sim::World world, double seconds, const sim::FleetOptions& options);

// The log that --log names, otherwise those of `names` that are available, otherwise a simulated building
// (with a warning).
[[nodiscard]] std::vector<StudyLog> ChooseLogs(StudyContext& context, const std::vector<std::string>& names,
                                               int max_scans = 0);

}  // namespace cairn::studies
