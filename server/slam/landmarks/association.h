// The association of one sighting with the landmarks of one hypothesis. The gates are kind and shape,
// position, the slopes of the lines on both sides, the squared Mahalanobis distance, and the distance
// travelled since the landmark was last counted. Source: thesis A 4.4, Table 4.3. Corrected: here "new"
// (Table 4.3, from line 6 on) is decided only after all entries were compared.
#pragma once

#include <cstddef>
#include <cstdint>

namespace cairn::slam {

enum class Verdict : std::uint8_t {
  kNew = 0,  // No similar landmark is near.
  kKnown,    // Exactly one landmark passes all gates.
  // A similar landmark is near but fails a gate, several pass, or the one was counted too recently.
  kIgnored,
};

struct Association {
  Verdict verdict = Verdict::kNew;
  std::size_t slot = 0;  // Slot of the landmark if the verdict is kKnown.
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
    if (!near_) return {Verdict::kNew, 0};
    return matches_ == 1 && !lately_ ? Association{Verdict::kKnown, slot_} : Association{Verdict::kIgnored, 0};
  }

 private:
  bool near_ = false;
  bool lately_ = false;
  int matches_ = 0;
  std::size_t slot_ = 0;
};

}  // namespace cairn::slam
