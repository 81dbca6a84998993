// The places where a robot may be: what its filter believes, and what it, or a job, has found while its place is not
// known (session_estimator.h).
#include <algorithm>
#include <utility>

#include "server/maps/localising_tiles.h"
#include "server/robots/most_believed.h"
#include "server/robots/session_estimator.h"

namespace cairn::server {
namespace {

// How often the poses of the particles are summed up for queries.
constexpr std::uint64_t kHypothesesPeriod_ns = kNanosPerSecond / 2;
// So long a place that a job has found is suggested again after checkpoints, by the robot's clock. A robot that stands
// still would otherwise have it for ever, and its journal would get the map with each checkpoint.
constexpr std::uint64_t kSuggestedAtMost_ns = 60 * kNanosPerSecond;

}  // namespace

void SessionEstimator::RefreshHypotheses(const PoseReport& report, bool in_known_map) {
  if (report.localized) looked_for_.clear();
  // By the robot's clock, which may be set back. What was believed of a robot that is lost now is gone at once.
  const bool changed = std::exchange(hypotheses_localized_, report.localized) != report.localized;
  const auto [earlier, later] = std::minmax(report.stamp, hypotheses_refreshed_);
  if (!changed && NanosBetween(earlier, later) < kHypothesesPeriod_ns) return;
  hypotheses_refreshed_ = report.stamp;
  std::vector<PoseHypothesis> hypotheses;
  if (report.localized) {
    // A robot that is only localised has one hypothesis: its filter stays where it stopped mapping.
    hypotheses = in_known_map ? std::vector<PoseHypothesis>{{report.stamp, report.T_map_robot, 1.0}}
                              : MostBelieved(pipeline_.mapper().belief(report.T_map_robot), report.stamp);
  } else {
    // What a fragment finds in its own map is a place in a frame of its own.
    if (!fragment_ || in_known_map) hypotheses = MostBelieved(pipeline_.mapper().UnconfirmedPlaces(), report.stamp);
    if (hypotheses.empty()) hypotheses = looked_for_;
  }
  record_.SetHypotheses(std::move(hypotheses));
}

void SessionEstimator::On(PlaceFound&& found) {
  const bool taken =
      !ended_ && found.place && found.place->map.epoch == epoch_ && Suggest(*found.place, std::move(found.map));
  if (taken) Store(std::move(*found.place));
  if (!record_.snapshot().status.pose.localized) {
    looked_for_ = std::move(found.places);
    record_.SetHypotheses(looked_for_);
  }
  found.done(taken);
}

bool SessionEstimator::Suggest(PlaceSuggested place, std::shared_ptr<const slam::KnownGrid> map) {
  // The map of a fragment has a frame of its own.
  if (fragment_ || map == nullptr || !pipeline_.mapper().SuggestPlace(place.seen, place.T_map_robot, map)) return false;
  suggested_ = Suggested{std::move(place), std::move(map)};
  return true;
}

// Forgets the place, and suggests it again: so does who reads the journal, with a checkpoint from here or from earlier,
// and comes to the same state.
void SessionEstimator::RepeatSuggestion() {
  if (!suggested_ || !pipeline_.mapper().has_suggestion()) return;
  PlaceSuggested place = suggested_->place;
  const Stamp now = record_.snapshot().status.pose.stamp;
  const bool is_old = now > place.seen && NanosBetween(place.seen, now) > kSuggestedAtMost_ns;
  pipeline_.mapper().ForgetSuggestion();
  if (is_old || !Suggest(place, suggested_->map)) place.map.tiles.clear();
  Store(std::move(place));
}

void SessionEstimator::ReplaySuggestion(const PlaceSuggested& place) {
  pipeline_.mapper().ForgetSuggestion();
  if (place.map.tiles.empty()) return;
  static_cast<void>(Suggest(place, KnownGridOf(place.map.tiles, place.map.resolution_m, place.map.epoch,
                                               options_.recovery.place, options_.self_check.near_m)));
}

}  // namespace cairn::server
