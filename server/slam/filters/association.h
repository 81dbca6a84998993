// Which of its own landmarks one hypothesis takes a sighting for. The gates: kind and shape, position, the slopes of
// the lines on both sides, the squared Mahalanobis distance, and the distance travelled since the landmark counted
// last. Source: thesis A 4.4, Table 4.3. Corrected: its line 6 on decides "new" only after all entries were compared.
#pragma once

#include <cstddef>
#include <cstdint>

namespace cairn::slam {

enum class Verdict : std::uint8_t {
  kNew = 0,  // Nothing like it is there.
  kKnown,    // Exactly one landmark it can be.
  kIgnored,  // Something like it is there, but not where it should be; several are; or it counted a moment ago.
};

struct Association {
  Verdict verdict = Verdict::kNew;
  std::size_t slot = 0;  // Of the landmark, where known.
};

// What comparing the sighting with one landmark of the hypothesis says.
enum class Likeness : std::uint8_t { kNone = 0, kNear, kMatch };

// Collects the comparisons of one sighting with every landmark that may be it.
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
