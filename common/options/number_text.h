// Numbers as people type them on a command line, read strictly: what is not wanted is not guessed at.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cairn {

// A finite decimal number at the start of the text, and what follows it: a unit, or nothing.
[[nodiscard]] std::optional<std::pair<double, std::string>> SplitNumber(const std::string& text);

// "a, b,c" -> "a", "b", "c": without blanks, and with what is empty.
[[nodiscard]] std::vector<std::string> SplitAtCommas(const std::string& text);

}  // namespace cairn
