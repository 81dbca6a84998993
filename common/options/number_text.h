// Numbers as text: what people type, read strictly (nothing is guessed), and what files hold. Stateless.
#pragma once

#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cairn {

// A finite decimal number at the start of the text, and what follows it: a unit, or nothing.
[[nodiscard]] std::optional<std::pair<double, std::string>> SplitNumber(const std::string& text);

// "a, b,c" -> "a", "b", "c": without blanks; empty parts are kept.
[[nodiscard]] std::vector<std::string> SplitAtCommas(const std::string& text);

// The shortest text that reads back to the same number. `Real` is float or double.
template <typename Real>
[[nodiscard]] std::string ExactText(Real value) {
  std::array<char, 48> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

}  // namespace cairn
