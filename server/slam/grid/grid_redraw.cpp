#include "server/slam/grid/grid_redraw.h"

#include <algorithm>

namespace cairn::slam {

bool GridRedraw::Advance(std::span<const Keyframe> keyframes, const SharedSequence<Pose2>& path, std::size_t count) {
  const std::size_t end = std::min(keyframes.size(), drawn_ + count);
  for (; drawn_ < end; ++drawn_) grid_.Draw(*keyframes[drawn_].scan, path[drawn_]);
  return drawn_ == keyframes.size();
}

}  // namespace cairn::slam
