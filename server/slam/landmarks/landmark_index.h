// Finds the landmarks that may be near a place, for all particles together. Each landmark has one box around
// all positions that any particle ever had for it. The result contains candidates that must still be
// compared, and no landmark is missed. This makes association per particle cheap: 200 particles with 500
// landmarks each compare only the few whose boxes intersect.
// Frame `map`. Bounded by the number of landmarks. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "server/slam/landmarks/landmark_sighting.h"

namespace cairn::slam {

class LandmarkIndex {
 public:
  // Makes room for `slot` and sets the kind of its landmark. One call per slot is enough.
  void Name(std::size_t slot, const LandmarkSignature& signature);
  // Extends the box of a landmark by the position that a particle has for it. REQUIRES: Name was called for
  // the slot.
  void Grow(std::size_t slot, const Eigen::Vector2d& p_map) { places_[slot].box.extend(p_map); }

  // Slots of similar landmarks that some particle may have within `box`.
  [[nodiscard]] std::vector<std::size_t> Near(const LandmarkSignature& signature, const Eigen::AlignedBox2d& box,
                                              const LandmarkOptions& options) const;
  [[nodiscard]] const LandmarkSignature& signature(std::size_t slot) const { return places_[slot].signature; }
  [[nodiscard]] std::size_t size() const { return places_.size(); }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.places_);
  }

 private:
  struct Place {
    LandmarkSignature signature;
    Eigen::AlignedBox2d box;  // Empty if no particle has the landmark.

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.signature, self.box);
    }
  };
  std::vector<Place> places_;  // Indexed by slot.
};

}  // namespace cairn::slam
