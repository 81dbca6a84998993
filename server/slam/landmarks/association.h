// The association of one sighting with the landmarks of one hypothesis. The gates are kind and shape,
// position, the slopes of the lines on both sides, the squared Mahalanobis distance, and the distance
// travelled since the landmark was last counted. Source: thesis A 4.4, Table 4.3. Corrected: here "new"
// (Table 4.3, from line 6 on) is decided only after all entries were compared.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "server/slam/landmarks/landmark_sighting.h"

namespace cairn::slam {

// Finds the landmarks that may be near a place, for all particles together. Each landmark has one box around
// all positions that any particle ever had for it. The result contains candidates that must still be
// compared, and no landmark is missed. This makes association per particle cheap: 200 particles with 500
// landmarks each compare only the few whose boxes intersect.
// Frame `map`. Bounded by the number of landmarks. Not thread-safe.
class LandmarkIndex {
 public:
  // Makes room for `slot` and sets the kind of its landmark, unless a particle has one there already.
  void Name(std::size_t slot, const LandmarkSignature& signature);
  // Extends the box of a landmark by the position that a particle has for it. REQUIRES: Name was called for
  // the slot.
  void Grow(std::size_t slot, const Eigen::Vector2d& p_map) {
    Eigen::AlignedBox2d& box = places_[slot].box;
    if (box.contains(p_map)) return;
    const Eigen::AlignedBox2d before = box;
    box.extend(p_map);
    Enter(slot, before);
  }

  // No particle has a landmark in the slots for which `used` is false. One flag per slot.
  void Forget(const std::vector<bool>& used);

  // Slots of similar landmarks that some particle may have within `box`.
  [[nodiscard]] std::vector<std::size_t> Near(const LandmarkSignature& signature, const Eigen::AlignedBox2d& box,
                                              const LandmarkOptions& options) const;
  [[nodiscard]] const LandmarkSignature& signature(std::size_t slot) const { return places_[slot].signature; }
  [[nodiscard]] std::size_t size() const { return places_.size(); }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.places_);
    if constexpr (Archive::kReads) self.EnterAll();
  }

 private:
  // The squares of the plane that a box touches, by their numbers in x and in y.
  struct Squares {
    int first_x = 0, last_x = -1;
    int first_y = 0, last_y = -1;

    [[nodiscard]] bool Contains(int x, int y) const {
      return first_x <= x && x <= last_x && first_y <= y && y <= last_y;
    }
    [[nodiscard]] std::size_t count() const {
      return static_cast<std::size_t>(last_x - first_x + 1) * static_cast<std::size_t>(last_y - first_y + 1);
    }
  };
  // Nothing if there are too many, or if the box is empty or not finite.
  [[nodiscard]] static std::optional<Squares> SquaresOf(const Eigen::AlignedBox2d& box);
  [[nodiscard]] static std::uint64_t KeyOf(int x, int y) {
    return (std::uint64_t{static_cast<std::uint32_t>(x)} << 32) | static_cast<std::uint32_t>(y);
  }
  // Enters a slot whose box has grown into the squares that are new to it.
  void Enter(std::size_t slot, const Eigen::AlignedBox2d& before);
  void EnterAll();

  struct Place {
    LandmarkSignature signature;
    Eigen::AlignedBox2d box;  // Empty if no particle has the landmark.

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.signature, self.box);
    }
  };
  std::vector<Place> places_;  // Indexed by slot.
  // The slots whose boxes touch a square, and those whose boxes are too large for that. They follow from the places.
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> by_square_;
  std::vector<std::uint32_t> large_;
};

enum class AssociationDecision : std::uint8_t {
  kNew = 0,  // No similar landmark is near.
  kKnown,    // Exactly one landmark passes all gates.
  // A similar landmark is near but fails a gate, several pass, or the one was counted too recently.
  kIgnored,
};

struct Association {
  AssociationDecision decision = AssociationDecision::kNew;
  std::size_t slot = 0;  // Slot of the landmark if the decision is kKnown.
};

// The result of comparing the sighting with one landmark of the hypothesis.
enum class Likeness : std::uint8_t { kNone = 0, kNear, kMatch };

// Collects the comparisons of one sighting with all landmarks of the hypothesis that are candidates.
class AssociationVote {
 public:
  void Add(std::size_t slot, Likeness likeness, bool counted_lately) {
    if (likeness == Likeness::kNone) return;
    near_ = true;
    if (likeness != Likeness::kMatch) return;
    ++matches_;
    slot_ = slot;
    lately_ = counted_lately;
  }
  [[nodiscard]] Association result() const {
    if (!near_) return {AssociationDecision::kNew, 0};
    return matches_ == 1 && !lately_ ? Association{AssociationDecision::kKnown, slot_}
                                     : Association{AssociationDecision::kIgnored, 0};
  }

 private:
  bool near_ = false;
  bool lately_ = false;
  int matches_ = 0;
  std::size_t slot_ = 0;
};

}  // namespace cairn::slam
