// Localisation in a known map of lines: the front-end's path, placed in the map and corrected by the lines of
// the scans. At first LineMatch searches the whole map until only one place is left (place_hypotheses.h);
// until then the robot is not placed. Afterwards it searches only the poses near the belief, and the
// hypothesis nearest to the belief is fused with it. If no such hypothesis is found over a long distance,
// health() reports that the robot is lost, and the whole map is searched again.
// Maps nothing: it has no landmarks and no revisits. Past poses are not corrected, even if the robot turns
// out to have been lost (the mapper has drawn them). Only when the robot is first placed, the path so far
// moves rigidly with it.
// Frames: T_map_robot; before the robot is placed, relative to the given start. Not thread-safe;
// deterministic, no random numbers.
// Source: thesis B 2.2.2 (LINEMATCH, (2.17)-(2.19)); Gutmann, Weigel, Nebel, 1999. Not in the sources: steps
// by the front-end instead of odometry in (2.17), and several hypotheses at the start, where the source needs
// one scan with a unique result.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/map/map_lines.h"
#include "server/slam/filters/filter.h"
#include "server/slam/localisation/line_match.h"
#include "server/slam/localisation/place_hypotheses.h"
#include "server/slam/reckoning/dead_reckoning_filter.h"

namespace cairn::slam {

struct LocalizationOptions {
  std::string file;  // The caller that makes the mapper reads it into `map` (common/map/map_lines.h).
  bool start_known = false;
  double start_sigma_m = 0.5;
  double start_sigma_rad = Radians(10.0);
  double every_m = 0.5;
  double max_reach_m = 60.0;
  double lost_after_m = 10.0;
  PlaceOptions places;
  LineMatchOptions search;
  // Filled from `file`, not from the configuration. Without a map the robot is never placed.
  std::shared_ptr<const std::vector<MapLine>> map;
};
void Visit(OptionVisitor& visitor, LocalizationOptions& options);

class LineLocalization final : public SinglePathFilter {
 public:
  LineLocalization(const LocalizationOptions& options, const BackEndOptions& back_end, const Pose2& T_map_robot_start);

  void Predict(const StepMotion& step) override;
  bool Observe(const RevisitObservation& /*revisit*/) override { return false; }
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  void Observe(std::span<const LineFeature> lines_robot, double travelled_m);

  [[nodiscard]] bool placed() const override { return placed_; }
  [[nodiscard]] FilterEstimate estimate() const override;
  [[nodiscard]] FilterHealth health() const override { return {1.0, nis_, nis_dimension_, placed_ && !tracking_}; }
  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.path_, self.places_, self.placed_, self.tracking_, self.found_in_a_row_, self.found_at_m_,
            self.searched_at_m_, self.nis_, self.nis_dimension_);
  }

 private:
  // Returns whether a hypothesis near the belief was found.
  bool Follow(std::span<const LineFeature> lines_robot);
  void SearchEverywhere(std::span<const LineFeature> lines_robot, double travelled_m);

  LocalizationOptions options_;
  MotionNoise drift_;
  PlaceHypotheses places_;
  bool placed_ = false;
  bool tracking_ = false;
  int found_in_a_row_ = 0;       // Number of keyframes in a row with a hypothesis near the belief.
  double found_at_m_ = 0.0;      // Travelled distance at the last hypothesis near the belief.
  double searched_at_m_ = -1e9;  // Travelled distance at the last search of the whole map.
  double nis_ = 0.0;
  int nis_dimension_ = 0;
};

}  // namespace cairn::slam
