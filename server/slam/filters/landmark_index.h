// Which landmarks may be near a place, whichever particle is asked: one box a landmark around everything any particle
// ever believed of its position. Answers are candidates to compare, never too few. It is what makes association per
// particle cheap: 200 particles with 500 landmarks each look at the few whose boxes touch.
// Frame `map`. Bounded by the number of landmarks. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "server/slam/filters/landmark_sighting.h"

namespace cairn::slam {

class LandmarkIndex {
 public:
  // Makes room for `slot` and says what kind of landmark it is; once for every slot is enough.
  void Name(std::size_t slot, const LandmarkSignature& signature);
  // A particle believes it here. REQUIRES: named.
  void Grow(std::size_t slot, const Eigen::Vector2d& p_map) { places_[slot].box.extend(p_map); }

  // Slots of like landmarks that some particle may have within `box`.
  [[nodiscard]] std::vector<std::size_t> Near(const LandmarkSignature& signature, const Eigen::AlignedBox2d& box,
                                              const LandmarkOptions& options) const;
  [[nodiscard]] const LandmarkSignature& signature(std::size_t slot) const { return places_[slot].signature; }
  [[nodiscard]] std::size_t size() const { return places_.size(); }

 private:
  struct Place {
    LandmarkSignature signature;
    Eigen::AlignedBox2d box;  // Empty where no particle has it.
  };
  std::vector<Place> places_;  // By slot.
};

}  // namespace cairn::slam
