// Whether what the robot sees and the map it drew itself can both be true. Every half metre or so the scan at the pose
// believed is compared with old keyframes nearby at the poses believed of them: points of either that stand where beams
// of the other went through are contradictions (witness.h). Only keyframes from an earlier visit are asked: those of
// the last metres drifted together with the robot and always agree. Where contradictions prevail over a stretch of way,
// which people, doors and a moved chair do not bring about, the belief is wrong, whatever the filter thinks of itself.
// Knows nothing where the robot believes to be where it never was, and little of errors along a corridor. Works
// alike for all matchers and filters: it reads the path only. Not thread-safe. Deterministic.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/filters/shared_sequence.h"
#include "server/slam/keyframe.h"
#include "server/slam/matching/region.h"
#include "server/slam/matching/witness.h"

namespace cairn::slam {

struct SelfCheckOptions {
  bool enabled = true;
  double min_travel_m = 15.0;   // Between the sightings compared; less: both may have drifted alike.
  double max_distance_m = 4.0;  // Between the robot and an old keyframe; more: seen from afar, said less surely.
  double every_m = 0.5;         // Travelled between looks; smaller: sooner, slower.
  double stretch_m = 5.0;       // Way the verdict is about; longer: surer, later.
  double near_m = 0.25;         // Poses and points may be wrong by this much; walls doubled by less are not noticed.
  double max_range_m = 10.0;    // Farther points suffer too much from small errors of the heading.
  double max_conflict = 0.4;    // Share of contradictions above which the pose is wrong; below half of it, right again.
};
void Visit(OptionVisitor& visitor, SelfCheckOptions& options);

class SelfCheck {
 public:
  explicit SelfCheck(const SelfCheckOptions& options) : options_(options) {}

  // The last keyframe has joined the path (one pose T_map_robot per keyframe).
  void Look(std::span<const Keyframe> keyframes, std::span<const KeyframeShape> shapes,
            const SharedSequence<Pose2>& path);
  // The path was put right: what was seen along the old one counts no more.
  void Forget();

  // Since the stretch that told so, until a stretch agrees again.
  [[nodiscard]] bool contradicted() const { return contradicted_; }

 private:
  struct Looked {
    double travelled_m = 0.0;
    Testimony testimony;
  };
  [[nodiscard]] std::vector<std::size_t> Witnesses(std::span<const KeyframeShape> shapes,
                                                   const SharedSequence<Pose2>& path) const;
  void Judge();

  SelfCheckOptions options_;
  double looked_at_m_ = 0.0;
  std::deque<Looked> looks_;  // Of the last stretch that had something to compare.
  bool contradicted_ = false;
};

}  // namespace cairn::slam
