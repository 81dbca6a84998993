// When a robot is compared with what others have drawn, and what the comparisons say of where somebody said it starts:
// StartCheck acts on it, and cairn-study starts measures it. One thread at a time.
#pragma once

#include <cstddef>

#include "server/maps/grid_agreement.h"

namespace cairn::server {

class StartJudgement {
 public:
  static constexpr double kEveryM = 1.0;  // Way between two comparisons.
  static constexpr double kFirstM = 8.0;  // Way on which they are made.

  // Takes the next comparison, when the robot has driven `way_m`. Whether the start is to be refused: one that
  // contradicts may be a coincidence, two in a row are none. Comparisons that tell nothing, as while the map is being
  // switched, do not count.
  [[nodiscard]] bool Refuses(const GridAgreement& agreement, double way_m) {
    const bool contradicts = agreement.Contradicts() || (way_m <= kNearStartM && ContradictsMuch(agreement));
    if (agreement.known()) contradictions_ = contradicts ? contradictions_ + 1 : 0;
    return contradictions_ >= kContradictions;
  }

 private:
  static constexpr int kContradictions = 2;
  // As long as neither its path nor the map can be bent by much, less is enough, if much is compared. (In a wide storey
  // a robot that had started where it said had 27 % after 6 m, because the path of the others had drifted.)
  static constexpr double kNearStartM = 5.5;
  [[nodiscard]] static bool ContradictsMuch(const GridAgreement& agreement) {
    constexpr std::size_t kMuch = 200;
    constexpr double kShare = 0.2;
    return agreement.compared >= kMuch && agreement.contradicted_share() >= kShare;
  }

  int contradictions_ = 0;
};

}  // namespace cairn::server
