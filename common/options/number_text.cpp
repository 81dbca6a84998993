#include "common/options/number_text.h"

#include <cmath>
#include <exception>

namespace cairn {

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

}  // namespace cairn
