// Two small measures that several criteria use: how two parallel lines lie beside each other, and how much of
// one pattern occurs in another. Any frame. Stateless, thread-safe. Source: thesis A 3.5.5 (Table 3.10,
// Figure 3.21), 3.5.7-3.5.8.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "server/slam/features/line_feature.h"

namespace cairn::slam {

// The position of line b along the direction of line a: beside it, wholly beyond its last end, or wholly
// before its first end.
enum class OverlapType : std::uint8_t { kOverlap, kBeyondLast, kBeforeFirst };
[[nodiscard]] OverlapType OverlapTypeOf(const LineFeature& a, const LineFeature& b);

// Goes through `walked` in order and takes for each entry the first later entry of `other` that differs by at
// most `tolerance`, as in the printed Tables 3.16 and 3.22. Blanks (NaN) are skipped. Differences of angles
// are wrapped. If `taken` is given, it receives the positions (in walked, in other). Returns the number of
// entries that agree.
[[nodiscard]] int PatternOverlap(std::span<const double> walked, std::span<const double> other, double tolerance,
                                 bool angles, std::vector<std::pair<int, int>>* taken = nullptr);

}  // namespace cairn::slam
