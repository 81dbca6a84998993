#include "tests/studies/joint/cut_log.h"

#include <algorithm>
#include <optional>

namespace cairn::studies {

std::vector<StudyLog> CutIntoParts(const StudyLog& log, std::size_t parts) {
  std::vector<StudyLog> cut(parts);
  for (std::size_t i = 0; i < parts; ++i) cut[i].name = log.name + " " + std::to_string(i + 1);
  const std::size_t each = log.scans() / parts + 1;
  std::size_t scans = 0;
  std::optional<Odometry> last;
  for (const LogRecord& record : log.records) {
    StudyLog& part = cut[std::min(scans / each, parts - 1)];
    if (part.records.empty() && last) part.records.emplace_back(*last);
    if (const auto* odometry = std::get_if<Odometry>(&record)) last = *odometry;
    part.records.push_back(record);
    scans += std::holds_alternative<Scan>(record) ? 1 : 0;
  }
  return cut;
}

}  // namespace cairn::studies
