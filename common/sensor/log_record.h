// One message of a robot log, whatever file format it came from.
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"

namespace cairn {

using LogRecord = std::variant<Odometry, Scan>;

// A line (of a bag: a message) that could not be read. It is skipped and counted.
struct LogComplaint {
  int line = 0;  // 1-based.
  std::string reason;
};

struct LogSummary {
  int scans = 0;
  int odometries = 0;
  int ignored = 0;                       // Messages of kinds that carry neither (PARAM, SYNC, ...).
  const char* entry = "line";            // What LogComplaint::line counts: lines of a log, or messages of a bag.
  std::vector<LogComplaint> complaints;  // The first 100.
  int complaint_count = 0;
  std::vector<std::string> notes;   // Conclusions from the content: range limit, mounting.
  std::vector<std::string> lidars;  // Of a bag: the topics of the scans that are read.
};

}  // namespace cairn
