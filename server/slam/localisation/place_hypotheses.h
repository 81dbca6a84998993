// The possible places of the robot in a known map while its place is not known: every result of LineMatch is
// a hypothesis, which is predicted with the steps and fused with later results near it. The evidence of a
// hypothesis is the share of the scans that it explained, where old scans count less and less. In places that
// look alike several hypotheses collect evidence, and only further motion distinguishes them. The place is
// settled once one hypothesis has clearly more evidence than any other. The number of hypotheses is bounded.
// Frames: T_map_robot. Not thread-safe; deterministic.
// Source: thesis B 2.2.2 ((2.17)-(2.19) for each hypothesis); several Gaussians at once: Jensfelt, Kristensen
// 2001.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/localisation/line_match.h"

namespace cairn::slam {

// The Kalman filter of one pose for LineMatch: a hypothesis from the map corrects the prediction (2.17),
// which is in motion/odometry_model.h. If the belief is Unknown(), the first hypothesis becomes the belief.
// Frames: T_map_robot. Plain values, thread-safe.
// Source: thesis B 2.2.2, (2.18), (2.19). Corrected: the third row of (2.17) adds the turn, not the distance;
// (2.18) fuses the predicted covariance in both lines; headings are fused as wrapped differences.
struct PoseBelief {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Covariance of (x, y, theta) in `map`.

  // The unknown pose (2.19), with 10^4 m and 10^2 rad for infinity.
  [[nodiscard]] static PoseBelief Unknown();

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_robot, self.covariance);
  }
};

// Squared Mahalanobis distance of a hypothesis from the belief.
[[nodiscard]] double DistanceOf(const PoseBelief& belief, const LineMatchHypothesis& hypothesis);

// Index of the hypothesis nearest to the belief, or nothing if its distance is above `gate` (chi-square, 3
// degrees of freedom).
[[nodiscard]] std::optional<std::size_t> Nearest(const PoseBelief& belief,
                                                 std::span<const LineMatchHypothesis> hypotheses, double gate = 16.3);

// Fuses the belief with a hypothesis, (2.18).
[[nodiscard]] PoseBelief Fuse(const PoseBelief& belief, const LineMatchHypothesis& hypothesis);

struct PlaceOptions {
  double memory = 0.8;
  double settled = 3.5;
  double rival_share = 0.6;
  std::int64_t most = 200;
};
void Visit(OptionVisitor& visitor, PlaceOptions& options);

class PlaceHypotheses {
 public:
  explicit PlaceHypotheses(const PlaceOptions& options) : options_(options) {}

  // Prediction with a step; `covariance_prev` is the covariance of its (x, y, theta) in the frame in which it
  // starts.
  void Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // Update with the result of a search of the whole map. A search that was cut short, or found no place, is
  // ignored.
  void Update(const LineMatchAnswer& answer);
  // The place, if it is settled.
  [[nodiscard]] std::optional<PoseBelief> settled() const;
  void Clear() { places_.clear(); }
  [[nodiscard]] std::size_t size() const { return places_.size(); }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.places_);
  }

 private:
  struct Place {
    PoseBelief belief;
    double evidence = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.belief, self.evidence);
    }
  };
  PlaceOptions options_;
  std::vector<Place> places_;  // The hypotheses, ordered by evidence, the most first.
};

}  // namespace cairn::slam
