#include "server/slam/landmarks/association.h"

namespace cairn::slam {

void LandmarkIndex::Name(std::size_t slot, const LandmarkSignature& signature) {
  if (slot >= places_.size()) places_.resize(slot + 1);
  if (places_[slot].box.isEmpty()) places_[slot].signature = signature;
}

std::vector<std::size_t> LandmarkIndex::Near(const LandmarkSignature& signature, const Eigen::AlignedBox2d& box,
                                             const LandmarkOptions& options) const {
  std::vector<std::size_t> near;
  for (std::size_t slot = 0; slot < places_.size(); ++slot)
    if (places_[slot].box.intersects(box) && Alike(places_[slot].signature, signature, options)) near.push_back(slot);
  return near;
}

}  // namespace cairn::slam
