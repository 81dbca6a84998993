// Reads quantities that people type on the command line, strictly: "12x" is an error, not 12. Every error quotes the
// text.
#pragma once

#include <string>

#include "common/map/tile.h"
#include "common/service/request.h"
#include "common/status.h"

namespace cairn::client {

// Seconds: "5", "2.5s", "500ms", "3m", "1h". Not negative.
[[nodiscard]] Result<double> ParseDuration(const std::string& text);

// "x_min,y_min,x_max,y_max" in metres, with x_min < x_max and y_min < y_max.
[[nodiscard]] Result<Area> ParseArea(const std::string& text);

// "LABEL=FILE" or "FILE" (labelled by its stem).
struct LabelledFile {
  std::string label;
  std::string path;
};
[[nodiscard]] LabelledFile ParseLabelledFile(const std::string& text);

// Seconds for people: "850 ms", "12.3 s", "4 min 05 s", "2 h 03 min".
[[nodiscard]] std::string FormatDuration(double seconds);

}  // namespace cairn::client
