// Seeded damage to good input: what a broken disk, a bad cable or an enemy makes of it. The same seed gives the same
// bytes on every machine.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Applies one to eight random edits: flipped bits, random bytes, cut-out, doubled or swapped pieces, truncation, and
// pieces from `dictionary`. Never longer than twice the input plus 4 KB.
inline std::string Mutate(std::string text, std::mt19937_64& random, const std::vector<std::string_view>& dictionary) {
  const std::size_t limit = 2 * text.size() + 4096;
  const auto pick = [&](std::size_t bound) { return bound == 0 ? 0 : static_cast<std::size_t>(random() % bound); };
  for (std::size_t edits = 1 + pick(8); edits > 0; --edits) {
    const std::size_t at = pick(text.size() + 1), length = pick(std::min<std::size_t>(text.size() - at, 64) + 1);
    switch (pick(7)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << pick(8)));
        break;
      case 1:
        if (at < text.size()) text[at] = static_cast<char>(pick(256));
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        if (text.size() + length <= limit) text.insert(at, text.substr(pick(text.size() + 1), length));
        break;
      case 4:
        if (pick(4) == 0) text.resize(at);
        break;
      case 5: {
        const std::string_view word = dictionary.empty() ? "" : dictionary[pick(dictionary.size())];
        if (text.size() + word.size() <= limit) text.replace(at, pick(2) * length, word);
        break;
      }
      default:
        if (at + length <= text.size()) text.replace(at, length, std::string(length, static_cast<char>(pick(256))));
        break;
    }
  }
  return text;
}

}  // namespace cairn
