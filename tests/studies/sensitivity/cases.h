// The drives on which the constants are judged, and the measures on each. Deterministic: the same seed gives
// the same figures.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/slam/mapper_options.h"
#include "tests/studies/logs.h"
#include "tests/studies/sensitivity/constants.h"
#include "tests/studies/study.h"

namespace cairn::studies {

enum class Yardstick : std::uint8_t {
  kRelations = 0,  // Mean error of the published relations.
  kTruth,          // Mean distance from the true positions.
  kOdometry,       // Mean distance from the odometry, if there is no better reference.
  kCrispness,      // Blur and thickness of the walls, if there is no truth.
};

// One drive under one base configuration.
struct Case {
  std::string name;   // Name of the log.
  std::string group;  // One column of the table.
  Runs runs = Runs::kUsual;
  Yardstick yardstick = Yardstick::kRelations;
  StudyLog log;
  slam::MapperOptions options;
};

// A name ("online", "smoothed", ...) and a figure; smaller is better. NaN where nothing could be measured.
using Figures = std::vector<std::pair<std::string, double>>;

// The cases for constants of this kind. Cases whose log is absent are reported and left out.
[[nodiscard]] std::vector<Case> CasesOf(StudyContext& context, Runs runs);

[[nodiscard]] Figures MeasureRun(const Case& one, const slam::MapperOptions& options);

}  // namespace cairn::studies
