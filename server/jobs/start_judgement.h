// When a robot is compared with what others have drawn, and what the comparisons say of where somebody said it starts:
// StartCheck acts on it, and cairn-study starts measures it. One thread at a time.
#pragma once

#include "server/maps/grid_agreement.h"

namespace cairn::server {

class StartJudgement {
 public:
  static constexpr double kEveryM = 1.0;  // Way between two comparisons.
  static constexpr double kFirstM = 8.0;  // Way on which they are made.

  // Takes the next comparison. Whether the start is to be refused: one that contradicts may be a coincidence, two in a
  // row are none. Comparisons that tell nothing, as while the map is being switched, do not count.
  [[nodiscard]] bool Refuses(const GridAgreement& agreement) {
    if (agreement.known()) contradictions_ = agreement.Contradicts() ? contradictions_ + 1 : 0;
    return contradictions_ >= kContradictions;
  }

 private:
  static constexpr int kContradictions = 2;

  int contradictions_ = 0;
};

}  // namespace cairn::server
