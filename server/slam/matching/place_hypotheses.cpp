#include "server/slam/matching/place_hypotheses.h"

#include <algorithm>
#include <cmath>

#include "server/slam/motion/dead_reckoning.h"

namespace cairn::slam {
namespace {

constexpr double kForgotten = 0.1;  // Evidence below which a place is dropped.

}  // namespace

void Visit(OptionVisitor& visitor, PlaceOptions& options) {
  visitor.Real("memory", options.memory, "1", 0.0, 0.99, "Share of the evidence left at the next search.");
  visitor.Real("settled", options.settled, "1", 0.0, 100.0,
               "Evidence of the place taken; at most 1 / (1 - memory) can be gathered.");
  visitor.Real("rival_share", options.rival_share, "1", 0.0, 1.0, "No other place has more than this share of it.");
  visitor.Integer("most", options.most, "1", 1, 100000, "Places kept: those with the most evidence.");
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
    // One answer feeds one place: the one with the most evidence.
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
