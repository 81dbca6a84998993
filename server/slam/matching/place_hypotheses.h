// Where in a known map the robot may be, while nobody knows: every answer of LineMatch is a hypothesis, carried along
// by the steps and fused with the answers near it. Evidence is what a hypothesis explained of the scans, old scans
// counting less and less; wherever the map looks alike, several gather it, and only the way tells them apart. Settled
// once one has clearly more than any other. Bounded. Frames: T_map_robot. Not thread-safe; deterministic. Source:
// thesis B 2.2.2 ((2.17)-(2.19) for each); several Gaussians at once: Jensfelt, Kristensen 2001.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/options/option_visitor.h"
#include "server/slam/matching/line_match.h"
#include "server/slam/matching/pose_fusion.h"

namespace cairn::slam {

struct PlaceOptions {
  double memory = 0.8;       // What is left of the evidence at the next search; larger: slower, surer.
  double settled = 3.5;      // Evidence of the place taken, of at most 1 / (1 - memory) ...
  double rival_share = 0.6;  // ... and no other place has more than this share of it.
  std::int64_t most = 200;   // Hypotheses kept: those with the most evidence.
};
void Visit(OptionVisitor& visitor, PlaceOptions& options);

class PlaceHypotheses {
 public:
  explicit PlaceHypotheses(const PlaceOptions& options) : options_(options) {}

  // The robot moved; `covariance_prev` of the step's (x, y, theta), in the frame it starts from.
  void Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // What a search of the whole map said. One that was cut short, or found no place at all, says nothing.
  void Update(const LineMatchAnswer& answer);
  // The place, if there is one.
  [[nodiscard]] std::optional<PoseBelief> settled() const;
  void Clear() { places_.clear(); }
  [[nodiscard]] std::size_t size() const { return places_.size(); }

 private:
  struct Place {
    PoseBelief belief;
    double evidence = 0.0;
  };
  PlaceOptions options_;
  std::vector<Place> places_;  // The most evidence first.
};

}  // namespace cairn::slam
