// Numbers as text: what people type, read strictly (nothing is guessed), and what files hold. Stateless.
#pragma once

#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace cairn {

// A finite decimal number at the start of the text, and what follows it: a unit, or nothing.
[[nodiscard]] std::optional<std::pair<double, std::string>> SplitNumber(const std::string& text);

// "a, b,c" -> "a", "b", "c": without blanks; empty parts are kept.
[[nodiscard]] std::vector<std::string> SplitAtCommas(const std::string& text);

// True if the whole text is one number of this type, which `value` then holds; NaN and infinity are numbers, too.
template <typename Number>
[[nodiscard]] bool ParseNumber(std::string_view text, Number& value) {
  Number parsed{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (error != std::errc() || end != text.data() + text.size()) return false;
  value = parsed;
  return true;
}

// The shortest text that reads back to the same number. `Real` is float or double.
template <typename Real>
[[nodiscard]] std::string ExactText(Real value) {
  std::array<char, 48> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

}  // namespace cairn
