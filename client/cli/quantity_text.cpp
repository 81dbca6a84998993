#include "client/cli/quantity_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

namespace cairn::client {
namespace {

// A finite number at the start of the text, and what follows it.
std::optional<std::pair<double, std::string>> SplitNumber(const std::string& text) {
  // strtod's spaces, hexadecimal, inf and nan are not wanted.
  if (text.empty() || text.find_first_not_of("+-.0123456789eE") == 0) return std::nullopt;
  if (text.find_first_of("xX") != std::string::npos) return std::nullopt;
  try {
    std::size_t used = 0;
    const double value = std::stod(text, &used);
    if (!std::isfinite(value)) return std::nullopt;
    return std::pair(value, text.substr(used));
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',') {
      parts.emplace_back();
    } else if (c != ' ') {
      parts.back() += c;
    }
  }
  return parts;
}

}  // namespace

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

Result<Pose2> ParsePose(const std::string& text) {
  const auto parts = SplitAtCommas(text);
  std::array<double, 3> values{};
  bool good = parts.size() == 3;
  for (std::size_t i = 0; good && i < 3; ++i) {
    const auto number = SplitNumber(parts[i]);
    const bool degrees = i == 2 && number && number->second == "deg";
    good = number && (number->second.empty() || degrees);
    if (good) values[i] = degrees ? Radians(number->first) : number->first;
  }
  if (!good || std::abs(values[2]) > 1e6) {
    return Fail(StatusCode::kInvalidArgument,
                fmt::format("'{}' is not a pose such as 1.5,-2,0.79 (metres, radians) or 1.5,-2,45deg", text));
  }
  return Pose2{values[0], values[1], WrapAngle(values[2])};
}

Result<std::optional<Pose2>> ParseStart(const std::string& text) {
  return ParsePose(text).map([](const Pose2& pose) { return std::optional(pose); });
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
