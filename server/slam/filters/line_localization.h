// Localisation in a known map of lines: the front-end's path, put in its place and kept there by what the scans' lines
// say. From nothing, LineMatch searches the whole map until one place is left (place_hypotheses.h); until then the
// robot is not placed. From then on it searches the lines within reach, and the answer nearest to the belief is fused
// with it. Where nothing near it is found for long, the robot says that it is lost and searches the whole map again.
// Maps nothing itself: no landmarks, no revisits, past poses stay, also those of a way that turns out to have been lost
// (which the mapper has drawn); but when the robot is first placed, the path so far moves with it as a whole. Frames:
// T_map_robot; before the robot is placed, relative to the start given. Not thread-safe; deterministic, no random
// numbers. Source: thesis B 2.2.2 (LINEMATCH, (2.17)-(2.19)); Gutmann, Weigel, Nebel, 1999. Beyond: steps by the
// front-end in place of odometry in (2.17), and several hypotheses at the start in place of waiting for a lucky scan.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/map/map_lines.h"
#include "server/slam/filters/back_end_options.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/reckoned_path.h"
#include "server/slam/matching/line_match.h"
#include "server/slam/matching/place_hypotheses.h"

namespace cairn::slam {

struct LocalizationOptions {
  std::string file;          // The map's lines (common/map/map_lines.h); who makes the mapper reads it into `map`.
  bool start_known = false;  // The start pose given is near the truth, by the two below; else it means nothing.
  double start_sigma_m = 0.5;
  double start_sigma_rad = Radians(10.0);
  double every_m = 0.5;  // Way between searches of the whole map.
  double max_reach_m =
      60.0;  // Round a place that is known lines are searched as far as the laser sees, but not farther.
  double lost_after_m = 10.0;  // Way on which nothing near the belief is found.
  PlaceOptions places;
  LineMatchOptions search;
  std::shared_ptr<const std::vector<MapLine>> map;  // Not an option of its own. Empty: never placed.
};
void Visit(OptionVisitor& visitor, LocalizationOptions& options);

class LineLocalization final : public Filter {
 public:
  LineLocalization(const LocalizationOptions& options, const BackEndOptions& back_end, const Pose2& T_map_robot_start);

  void Predict(const StepMotion& step) override;
  bool Observe(const RevisitObservation& /*revisit*/) override { return false; }
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  void Observe(std::span<const LineFeature> lines_robot, double travelled_m);
  void Commit() override { path_.Keep(); }

  [[nodiscard]] bool placed() const override { return placed_; }
  [[nodiscard]] FilterEstimate estimate() const override;
  [[nodiscard]] FilterHealth health() const override { return {1.0, nis_, nis_dimension_, placed_ && !tracking_}; }
  [[nodiscard]] std::size_t hypothesis_count() const override { return 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t /*index*/) const override {
    return {path_.T_map_robot(), path_.path()};
  }
  [[nodiscard]] std::vector<Landmark> landmarks() const override { return {}; }

 private:
  // Whether something near the belief was found.
  bool Follow(std::span<const LineFeature> lines_robot);
  void SearchEverywhere(std::span<const LineFeature> lines_robot, double travelled_m);

  LocalizationOptions options_;
  MotionNoise drift_;
  ReckonedPath path_;
  PlaceHypotheses places_;
  bool placed_ = false;
  bool tracking_ = false;
  int found_in_a_row_ = 0;       // Keyframes, now.
  double found_at_m_ = 0.0;      // Way at which something near the belief was last found.
  double searched_at_m_ = -1e9;  // The same of the last search of the whole map.
  double nis_ = 0.0;
  int nis_dimension_ = 0;
};

}  // namespace cairn::slam
