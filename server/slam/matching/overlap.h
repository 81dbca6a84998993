// Two small measures the criteria share: how two parallel lines lie beside each other, and how much of one pattern is
// found in another. Any frame. Stateless, thread-safe. Source: thesis A 3.5.5 (Table 3.10, Figure 3.21), 3.5.7-3.5.8.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "server/slam/features/line_feature.h"

namespace cairn::slam {

// Where line b lies along the direction of line a: beside it, wholly beyond its last end, or wholly before its first.
enum class OverlapType : std::uint8_t { kOverlap, kBeyondLast, kBeforeFirst };
[[nodiscard]] OverlapType OverlapTypeOf(const LineFeature& a, const LineFeature& b);

// Walks `walked` in order and takes for each entry the first later entry of `other` within `tolerance`: what the
// printed Tables 3.16 and 3.22 are made of. Blanks (NaN) are skipped. Angles are compared wrapped. `taken`, where
// given, receives the positions (in walked, in other). Returns how many agree.
[[nodiscard]] int PatternOverlap(std::span<const double> walked, std::span<const double> other, double tolerance,
                                 bool angles, std::vector<std::pair<int, int>>* taken = nullptr);

}  // namespace cairn::slam
