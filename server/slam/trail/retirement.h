// The keyframes that a trail gives up because others show the same (retirement_choice.h; the field speaks of keyframe
// culling and graph reduction), and what becomes of their indices. Plain values.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct Retirement {
  std::vector<std::size_t> kept;  // The keyframes that stay, by their indices before, in order.
  std::vector<std::size_t>
      representative;                    // Per keyframe: a kept one near it, by its index before; itself if it stays.
  std::vector<std::size_t> index_after;  // Per keyframe: the index afterwards of its representative.
  std::vector<Pose2> T_representative_keyframe;

  [[nodiscard]] bool IsKept(std::size_t keyframe) const { return representative[keyframe] == keyframe; }
};

// Leaves only the values of the kept keyframes. REQUIRES: one value per keyframe.
template <typename T>
void KeepOnly(std::vector<T>& values, const Retirement& retirement) {
  std::size_t to = 0;
  for (const std::size_t from : retirement.kept) {
    if (to != from) values[to] = std::move(values[from]);
    ++to;
  }
  values.erase(values.begin() + static_cast<std::ptrdiff_t>(to), values.end());
  values.shrink_to_fit();
}

}  // namespace cairn::slam
