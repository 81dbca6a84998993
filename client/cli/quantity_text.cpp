#include "client/cli/quantity_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "common/options/number_text.h"

namespace cairn::client {

Result<double> ParseDuration(const std::string& text) {
  static constexpr std::array<std::pair<std::string_view, double>, 5> kUnits = {
      {{"", 1.0}, {"s", 1.0}, {"ms", 1e-3}, {"m", 60.0}, {"h", 3600.0}}};
  const auto number = SplitNumber(text);
  if (number && number->first >= 0.0) {
    for (const auto& [unit, seconds] : kUnits) {
      if (number->second == unit) return number->first * seconds;
    }
  }
  return Fail(StatusCode::kInvalidArgument, fmt::format("'{}' is not a duration such as 5, 2.5s, 500ms, 3m, 1h", text));
}

Result<Area> ParseArea(const std::string& text) {
  const auto parts = SplitAtCommas(text);
  std::array<double, 4> values{};
  bool good = parts.size() == 4;
  for (std::size_t i = 0; good && i < 4; ++i) {
    const auto number = SplitNumber(parts[i]);
    good = number && number->second.empty();
    if (good) values[i] = number->first;
  }
  if (!good || values[0] >= values[2] || values[1] >= values[3]) {
    return Fail(StatusCode::kInvalidArgument,
                fmt::format("'{}' is not an area such as -5,-5,20,10 (x_min,y_min,x_max,y_max in metres)", text));
  }
  return Area{values[0], values[1], values[2], values[3]};
}

LabelledFile ParseLabelledFile(const std::string& text) {
  const auto equals = text.find('=');
  if (equals != std::string::npos && equals > 0) return {text.substr(0, equals), text.substr(equals + 1)};
  return {std::filesystem::path(text).stem().string(), text};
}

std::string FormatDuration(double seconds) {
  if (!std::isfinite(seconds)) return "?";
  if (seconds < 0.9995) return fmt::format("{:.0f} ms", seconds * 1e3);
  if (seconds < 99.95) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<long long>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{} min {:02d} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02d} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace cairn::client
