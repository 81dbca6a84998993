#include "server/slam/localisation/place_hypotheses.h"

#include <algorithm>
#include <cmath>

#include "server/slam/motion/dead_reckoning.h"

namespace cairn::slam {
namespace {

constexpr double kForgotten = 0.1;  // Evidence below which a hypothesis is dropped.

}  // namespace

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
