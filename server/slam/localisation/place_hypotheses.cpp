#include "server/slam/localisation/place_hypotheses.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/geometry/pose_difference.h"
#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {
namespace {

Eigen::Vector3d From(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  return Minus(hypothesis.T_map_robot, belief.T_map_robot);
}

constexpr double kForgotten = 0.1;  // Evidence below which a hypothesis is dropped.

}  // namespace

PoseBelief PoseBelief::Unknown() {
  return {{}, Eigen::Vector3d(1e8, 1e8, 1e4).asDiagonal()};
}

double DistanceOf(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  const Eigen::Vector3d away = From(belief, hypothesis);
  return away.dot((belief.covariance + hypothesis.covariance).ldlt().solve(away));
}

std::optional<std::size_t> Nearest(const PoseBelief& belief, std::span<const LineMatchHypothesis> hypotheses,
                                   double gate) {
  std::optional<std::size_t> nearest;
  double best = gate;
  for (std::size_t h = 0; h < hypotheses.size(); ++h) {
    const double distance = DistanceOf(belief, hypotheses[h]);
    if (distance >= best) continue;
    best = distance;
    nearest = h;
  }
  return nearest;
}

PoseBelief Fuse(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  // (2.18) with P (P + S)^-1 instead of the sum of inverses: equivalent, and stable for a huge P.
  const Eigen::Matrix3d& P = belief.covariance;
  const Eigen::Matrix3d K = (P + hypothesis.covariance).ldlt().solve(P).transpose();
  const Eigen::Matrix3d left = Eigen::Matrix3d::Identity() - K;
  // Joseph's form stays positive definite for a huge P.
  PoseBelief fused{Plus(belief.T_map_robot, K * From(belief, hypothesis)),
                   left * P * left.transpose() + K * hypothesis.covariance * K.transpose()};
  fused.covariance = 0.5 * (fused.covariance + fused.covariance.transpose()).eval();
  return fused;
}

void Visit(OptionVisitor& visitor, PlaceOptions& options) {
  visitor.Real("memory", options.memory, "1", 0.0, 0.99,
               "Share of the evidence for a place that is left at the next search. A larger value decides later and "
               "more safely.");
  visitor.Real("settled", options.settled, "1", 0.0, 100.0,
               "A place is accepted when its evidence reaches this. The evidence never exceeds 1 / (1 - memory).");
  visitor.Real("rival_share", options.rival_share, "1", 0.0, 1.0,
               "A place is accepted only if no other one has more than this share of its evidence.");
  visitor.Integer("most", options.most, "1", 1, 100000,
                  "Number of places that are kept: those with the most evidence.");
  visitor.Require(options.settled * (1.0 - options.memory) < 1.0, "settled", "must be below 1 / (1 - memory), with",
                  "memory");
}

void PlaceHypotheses::Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  for (Place& place : places_)
    DeadReckon(place.belief.T_map_robot, place.belief.covariance, T_prev_curr, covariance_prev);
}

void PlaceHypotheses::Update(const LineMatchAnswer& answer) {
  if (!answer.complete || answer.hypotheses.empty()) return;
  std::vector<char> taken(answer.hypotheses.size(), 0);
  for (Place& place : places_) {
    place.evidence *= options_.memory;
    const auto near = Nearest(place.belief, answer.hypotheses);
    if (!near) continue;
    // One result updates only one hypothesis, the one with the most evidence.
    if (taken[*near] != 0) continue;
    taken[*near] = 1;
    place.belief = Fuse(place.belief, answer.hypotheses[*near]);
    place.evidence += answer.hypotheses[*near].share;
  }
  for (std::size_t h = 0; h < answer.hypotheses.size(); ++h)
    if (taken[h] == 0)
      places_.push_back({Fuse(PoseBelief::Unknown(), answer.hypotheses[h]), answer.hypotheses[h].share});
  std::erase_if(places_, [](const Place& place) { return place.evidence < kForgotten; });
  std::ranges::stable_sort(places_, [](const Place& a, const Place& b) { return a.evidence > b.evidence; });
  if (places_.size() > static_cast<std::size_t>(options_.most)) places_.resize(static_cast<std::size_t>(options_.most));
}

std::optional<PoseBelief> PlaceHypotheses::settled() const {
  if (places_.empty() || places_.front().evidence < options_.settled) return std::nullopt;
  if (places_.size() > 1 && places_[1].evidence > options_.rival_share * places_.front().evidence) return std::nullopt;
  return places_.front().belief;
}

}  // namespace cairn::slam
