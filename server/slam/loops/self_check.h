// Checks whether the present scans agree with the map that the robot itself has drawn. About every half metre
// the scan at the believed pose is compared with old keyframes nearby at their believed poses. Points of
// either that lie where beams of the other passed are contradictions (visibility.h). Only keyframes from an
// earlier visit are compared, because those of the last metres have drifted together with the robot and
// always agree. If contradictions prevail over a stretch (people, doors and a moved chair do not cause that),
// the belief is wrong, whatever the filter's covariance is.
// It has no evidence in places that were never visited, and little about errors along a corridor. It works
// for all matchers and filters, because it uses only the path and the scans. Not thread-safe. Deterministic.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/loops/visibility.h"
#include "server/slam/trail/path_index.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

struct SelfCheckOptions {
  bool enabled = true;
  double min_travel_m = 15.0;
  double near_m = 0.25;
  double max_conflict = 0.4;
};
void Visit(OptionVisitor& visitor, SelfCheckOptions& options);

class SelfCheck {
 public:
  explicit SelfCheck(const SelfCheckOptions& options) : options_(options) {}

  // Compares the last keyframe, which is already in the path (one pose T_map_robot per keyframe), with old
  // ones. `index` follows the path.
  void Look(const Trail& trail, const PathIndex& index);
  // Discards the comparisons along the old path after the path was corrected.
  void Forget();

  // True from the stretch that contradicts the map until a stretch agrees with it again.
  [[nodiscard]] bool contradicted() const { return contradicted_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.compared_at_m_, self.comparisons_, self.contradicted_);
  }

 private:
  struct Comparison {
    double travelled_m = 0.0;
    VisibilityCounts counts;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.travelled_m, self.counts.confirmed, self.counts.contradicted);
    }
  };
  [[nodiscard]] std::vector<std::size_t> KeyframesToCompare(std::span<const KeyframeShape> shapes,
                                                            const PathIndex& index) const;
  void UpdateContradicted();

  SelfCheckOptions options_;
  double compared_at_m_ = 0.0;
  std::deque<Comparison> comparisons_;  // The comparisons over the last stretch with enough points.
  bool contradicted_ = false;
};

}  // namespace cairn::slam
