#include "server/slam/site/relation_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "common/geometry/pose_difference.h"
#include "server/slam/loops/region.h"
#include "server/slam/loops/stretch_match.h"
#include "server/slam/loops/unique_pose.h"
#include "server/slam/loops/visibility.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/site/ties.h"

namespace cairn::slam {
namespace {

// Places.
constexpr double kPlaceEveryM = 5.0;       // Way between two places that are looked for, at least, ...
constexpr double kMostSought = 60.0;       // ... and so many of a session at most.
constexpr double kHalfStretchM = 7.5;      // What is seen within this way to either side belongs to a place.
constexpr double kShortestStretchM = 7.5;  // Less way shows too little to be unlike all other places.

// Revisits.
constexpr double kMaxRevisitWayM = 25.0;  // Farther from the nearest tie the guess is too bad for one scan.
constexpr double kGuessSigmaM = 0.5;      // Standard deviations of a guess in the alignment, as for one robot.
constexpr double kGuessSigmaRad = 0.15;
constexpr double kMinRevisitScore = 0.6;  // Share of the points of the scan that must be explained.
// Added to a match of two sessions, whose maps are bent in different ways. Much more than for one robot.
constexpr double kRevisitSigmaM = 0.1;
constexpr double kRevisitSigmaRad = 0.02;
constexpr double kCorrectionM = 0.3;      // A revisit may correct the guess by so much, ...
constexpr double kCorrectionPerM = 0.03;  // ... and more with the way from the nearest tie.
constexpr int kMinRevisitPoints = 20;     // Points.

// Stretches.
constexpr double kRevisitNearM = 3.0;  // No stretch is compared within this way of a revisit.

// What was measured before. Of two keyframes that are as near as each other now the one, now the other is the nearest,
// so the one that was measured stays the nearest as long as no other is by so much nearer.
constexpr double kStickyM = 0.2;
constexpr double kStickyShare = 0.1;  // Of the reach of a search for stretches.
// The last keyframe of a place is the same as before if it lies where that did.
constexpr double kSameM = 0.05;
constexpr double kGrown = 1.25;  // Ratio of keyframes made from which a map counts as another one.

// Stops calling `go_on` once it has said no.
class Asking {
 public:
  explicit Asking(const GoOn& go_on) : go_on_(go_on) {}
  bool operator()() {
    goes_on_ = goes_on_ && (!go_on_ || go_on_());
    return goes_on_;
  }

 private:
  const GoOn& go_on_;
  bool goes_on_ = true;
};

double WayOf(std::span<const RecentScan> scans) {
  return scans.empty() ? 0.0 : scans.back().travelled_m - scans.front().travelled_m;
}

class NearbySearch {
 public:
  NearbySearch(const PlacedSession& known, const PlacedSession& seen, std::span<const Tie> ties,
               const SiteOptions& options, RelationBook& book)
      : known_(known),
        seen_(seen),
        ties_(ties),
        options_(options),
        align_(options.align),
        book_(book),
        pair_{known.map.session(), seen.map.session()} {
    align_.min_score = kMinRevisitScore;
  }

  // The guess of where keyframe `seen` lies relative to `known`.
  [[nodiscard]] Pose2 Guess(std::size_t known, std::size_t seen) const {
    return Between(known_.path[known], seen_.path[seen]);
  }

  // The way from the nearest tie to the two keyframes, along both sessions.
  [[nodiscard]] double WayFromTie(std::size_t known, std::size_t seen) const {
    return slam::WayFromTie(ties_, known_.map, known, seen_.map, seen);
  }

  [[nodiscard]] std::optional<SessionRelation> Revisit(std::size_t seen) {
    const Measurement* const before = book_.Find(pair_, MeasurementKind::kRevisit, seen_.map.id(seen));
    const auto centre = NearestKeyframe(seen, before);
    if (!centre) return std::nullopt;
    const double way_m = WayFromTie(*centre, seen);
    if (way_m > kMaxRevisitWayM) return std::nullopt;
    const Pose2 guess = Guess(*centre, seen);
    const auto is_near = [&](const Pose2& T_known_seen) {
      return (T_known_seen.translation() - guess.translation()).norm() <= kCorrectionM + kCorrectionPerM * way_m;
    };
    if (Holds(before, *centre, guess, way_m) && (!before->found || is_near(before->T_known_seen)))
      return Again(*before, *centre, seen);
    auto measured = MeasureRevisit(*centre, seen, guess, is_near);
    Note(MeasurementKind::kRevisit, {*centre, seen}, guess, way_m, measured);
    return measured;
  }

  [[nodiscard]] std::optional<SessionRelation> StretchSeenAgain(std::size_t seen) {
    const Measurement* const before = book_.Find(pair_, MeasurementKind::kStretch, seen_.map.id(seen));
    const auto centre = LikeliestKeyframe(seen, before);
    if (!centre) return std::nullopt;
    const Pose2 guess = Guess(*centre, seen);
    const double way_m = WayFromTie(*centre, seen);
    if (Holds(before, *centre, guess, way_m)) return Again(*before, *centre, seen);
    auto measured = MeasureStretch(*centre, seen, WindowAround(guess, way_m, options_.loop));
    Note(MeasurementKind::kStretch, {*centre, seen}, guess, way_m, measured);
    return measured;
  }

  // Whether two stretches agree, each carried to the same keyframes along the sessions' own paths.
  [[nodiscard]] bool Confirm(const SessionRelation& a, const SessionRelation& b) const {
    const auto& known = known_.map;
    const auto& seen = seen_.map;
    const double apart_m = std::abs(seen.travelled_m(a.to.keyframe) - seen.travelled_m(b.to.keyframe));
    if (apart_m < options_.loop.confirm_after_m || apart_m > kConfirmWithinM) return false;
    if (std::abs(known.travelled_m(a.from.keyframe) - known.travelled_m(b.from.keyframe)) > 2.0 * kStretchM)
      return false;
    const auto step = [](const SessionMap& map, std::size_t from, std::size_t to) {
      return Between(map.own_path()[from], map.own_path()[to]);
    };
    return ConfirmEachOther(a.T_from_to * step(seen, a.to.keyframe, b.to.keyframe),
                            step(known, a.from.keyframe, b.from.keyframe) * b.T_from_to);
  }

 private:
  // Whether the earlier measurement is one of the same two keyframes and still says what a new one would.
  [[nodiscard]] bool Holds(const Measurement* before, std::size_t known, const Pose2& guess, double way_m) const {
    return before != nullptr && before->known == known_.map.id(known) && before->Holds(guess, way_m);
  }

  [[nodiscard]] std::optional<SessionRelation> Again(const Measurement& before, std::size_t known, std::size_t seen) {
    book_.CountReused();
    if (!before.found) return std::nullopt;
    return SessionRelation{{known_.number, known}, {seen_.number, seen}, before.T_known_seen, before.covariance};
  }

  void Note(MeasurementKind kind, const Tie& keyframes, const Pose2& guess, double way_m,
            const std::optional<SessionRelation>& measured) {
    Measurement one{.known = known_.map.id(keyframes.known),
                    .seen = seen_.map.id(keyframes.seen),
                    .guess = guess,
                    .way_m = way_m,
                    .known_made = known_.map.made(),
                    .seen_made = seen_.map.made(),
                    .found = measured.has_value()};
    if (measured) {
      one.T_known_seen = measured->T_from_to;
      one.covariance = measured->covariance;
    }
    book_.Note(pair_, kind, one);
  }

  [[nodiscard]] std::optional<SessionRelation> MeasureRevisit(std::size_t centre, std::size_t seen, const Pose2& guess,
                                                              const std::function<bool(const Pose2&)>& is_near) {
    BuildReference(centre);
    const Trail& of_known = known_.map.trail();
    const Trail& of_seen = seen_.map.trail();
    const auto match = AlignPointsToSurfaces(*of_seen.points(seen), reference_,
                                             {guess, guess, PoseCovariance(kGuessSigmaM, kGuessSigmaRad)}, align_);
    if (!match.converged || !is_near(match.T_ref_curr)) return std::nullopt;
    const VisibilityCounts counts =
        CompareBothWays(*of_known.keyframes()[centre].scan, *of_known.points(centre), *of_seen.keyframes()[seen].scan,
                        *of_seen.points(seen), match.T_ref_curr, options_.self_check.near_m);
    if (counts.known() < kMinRevisitPoints || counts.contradicted > options_.loop.max_conflict * counts.known())
      return std::nullopt;
    return SessionRelation{{known_.number, centre},
                           {seen_.number, seen},
                           match.T_ref_curr,
                           match.covariance + PoseCovariance(kRevisitSigmaM, kRevisitSigmaRad)};
  }

  [[nodiscard]] std::optional<SessionRelation> MeasureStretch(std::size_t centre, std::size_t seen,
                                                              const SearchWindow& window) const {
    const Trail& of_known = known_.map.trail();
    const Trail& of_seen = seen_.map.trail();
    const auto T_known_seen =
        MatchStretches(of_known, StretchAround(of_known.shapes(), centre, kStretchM), of_seen,
                       StretchAround(of_seen.shapes(), seen, kHalfStretchM), window, options_.loop, options_.align);
    if (!T_known_seen) return std::nullopt;
    return SessionRelation{{known_.number, centre},
                           {seen_.number, seen},
                           *T_known_seen,
                           PoseCovariance(options_.loop.sigma_m, kFoundSigmaRad)};
  }

  // As for the revisits of one robot: near, and with a similar heading.
  [[nodiscard]] std::optional<std::size_t> NearestKeyframe(std::size_t seen, const Measurement* before) const {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    std::optional<std::size_t> nearest;
    double best = kNone;
    const Pose2& here = seen_.path[seen];
    const RevisitOptions& revisit = options_.revisit;
    const auto cost_of = [&](std::size_t k, const Pose2& there) {
      const double distance = (there.translation() - here.translation()).norm();
      const double turn = std::abs(AngleDiff(there.theta, here.theta));
      const bool counts = distance <= revisit.max_distance_m && turn <= revisit.max_turn_rad && known_.map.localized(k);
      return counts ? distance + revisit.max_distance_m * turn / revisit.max_turn_rad : kNone;
    };
    ForEachNear(known_.path, known_.path.size(), here.translation(), revisit.max_distance_m,
                [&](std::size_t k, const Pose2& there) {
                  const double cost = cost_of(k, there);
                  if (cost >= best) return;
                  best = cost;
                  nearest = k;
                });
    const auto last = before == nullptr ? std::nullopt : known_.map.IndexOf(before->known);
    return last && cost_of(*last, known_.path[*last]) <= best + kStickyM && best < kNone ? last : nearest;
  }

  // As for large loops: the least distance, measured by how uncertain it is.
  [[nodiscard]] std::optional<std::size_t> LikeliestKeyframe(std::size_t seen, const Measurement* before) const {
    constexpr std::size_t kStride = 4;
    std::optional<std::size_t> likeliest;
    double best = 1.0;
    const Pose2& here = seen_.path[seen];
    const auto cost_of = [&](std::size_t k, const Pose2& there) {
      const double away_m = (there.translation() - here.translation()).norm();
      if (away_m >= options_.loop.max_doubt_m || !known_.map.localized(k)) return 1.0;
      return away_m / WindowAround({}, WayFromTie(k, seen), options_.loop).reach_m;
    };
    ForEachNear(known_.path, known_.path.size(), here.translation(), options_.loop.max_doubt_m,
                [&](std::size_t k, const Pose2& there) {
                  if (k % kStride != 0) return;
                  const double cost = cost_of(k, there);
                  if (cost >= best) return;
                  best = cost;
                  likeliest = k;
                });
    const auto last = before == nullptr ? std::nullopt : known_.map.IndexOf(before->known);
    return last && cost_of(*last, known_.path[*last]) < std::min(1.0, best + kStickyShare) ? last : likeliest;
  }

  void BuildReference(std::size_t centre) {
    if (built_for_ == centre) return;
    built_for_ = centre;
    reference_.Clear();
    const auto reach = static_cast<std::size_t>(options_.revisit.neighbours);
    const Stretch around{centre > reach ? centre - reach : 0, std::min(known_.map.size() - 1, centre + reach), centre};
    ForEachSurface(known_.map.trail(), around, [&](const SurfacePoint& surface) { reference_.Add(surface); });
  }

  const PlacedSession known_;
  const PlacedSession seen_;
  const std::span<const Tie> ties_;
  const SiteOptions& options_;
  PointToLineOptions align_;
  PointIndex reference_;  // Of the keyframe built_for_.
  std::optional<std::size_t> built_for_;
  RelationBook& book_;
  const RelationBook::Pair pair_;  // By ids.
};

// Whether a map has so many more keyframes that what was not like any other place, or not there, may be now.
bool HasGrown(std::uint64_t made_then, std::uint64_t made_now) {
  return static_cast<double>(made_now) >= kGrown * static_cast<double>(made_then);
}

// The same place, searched in the whole map of `known`.
std::optional<SessionRelation> MeasurePlace(std::size_t known_number, SessionMap& known, std::size_t seen_number,
                                            SessionMap& seen, std::size_t keyframe, const LoopOptions& options) {
  const std::vector<RecentScan> scans = seen.ScansAround(keyframe, kHalfStretchM);
  if (WayOf(scans) < kShortestStretchM) return std::nullopt;
  const auto place = known.Find(scans);
  if (!place) return std::nullopt;
  const double score = known.ScoreAt(scans, place->T_map_robot);
  if (seen.FitsElsewhere(scans, scans.back().T_track_robot, options.max_rival * score)) return std::nullopt;
  const std::size_t nearest = known.NearestTo(place->T_map_robot);
  return SessionRelation{{known_number, nearest},
                         {seen_number, seen.LastAround(keyframe, kHalfStretchM)},
                         Between(known.own_path()[nearest], place->T_map_robot),
                         place->covariance};
}

}  // namespace

std::vector<std::size_t> PlacesToLookFor(const SessionMap& seen) {
  std::vector<std::size_t> places;
  if (seen.size() == 0) return places;
  // Doubled, so that those of a longer way are among those of before.
  double every_m = kPlaceEveryM;
  while (every_m * kMostSought < seen.travelled_m(seen.size() - 1)) every_m *= 2.0;
  double next_m = 0.0;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    if (seen.travelled_m(k) < next_m || !seen.localized(k)) continue;
    next_m = seen.travelled_m(k) + every_m;
    places.push_back(k);
  }
  return places;
}

std::size_t FirstOfPlace(const SessionMap& seen, std::size_t keyframe) {
  return StretchAround(seen.trail().shapes(), keyframe, kHalfStretchM).first;
}

std::optional<SessionRelation> RecognisePlace(std::size_t known_number, SessionMap& known, std::size_t seen_number,
                                              SessionMap& seen, std::size_t keyframe, const LoopOptions& options,
                                              RelationBook& book) {
  const RelationBook::Pair pair{known.session(), seen.session()};
  const std::size_t last = seen.LastAround(keyframe, kHalfStretchM);
  const Pose2 T_keyframe_last = Between(seen.own_path()[keyframe], seen.own_path()[last]);
  const Measurement* const before = book.Find(pair, MeasurementKind::kPlace, seen.id(keyframe));
  if (before != nullptr && !HasGrown(before->known_made, known.made()) && !HasGrown(before->seen_made, seen.made()) &&
      Between(before->guess, T_keyframe_last).translation().norm() < kSameM) {
    const auto nearest = before->found ? known.IndexOf(before->known) : std::nullopt;
    if (!before->found || nearest) book.CountReused();
    if (!before->found) return std::nullopt;
    if (nearest)
      return SessionRelation{{known_number, *nearest}, {seen_number, last}, before->T_known_seen, before->covariance};
  }
  auto place = MeasurePlace(known_number, known, seen_number, seen, keyframe, options);
  Measurement one{.seen = seen.id(keyframe),
                  .guess = T_keyframe_last,
                  .known_made = known.made(),
                  .seen_made = seen.made(),
                  .found = place.has_value()};
  if (place) {
    one.known = known.id(place->from.keyframe);
    one.T_known_seen = place->T_from_to;
    one.covariance = place->covariance;
  }
  book.Note(pair, MeasurementKind::kPlace, one);
  return place;
}

std::vector<SessionRelation> FindRelationsNearby(const PlacedSession& known, const PlacedSession& seen,
                                                 std::span<const Tie> ties, const SiteOptions& options,
                                                 const GoOn& go_on, RelationBook& book) {
  Asking goes_on(go_on);
  NearbySearch search(known, seen, ties, options, book);
  std::vector<SessionRelation> found;
  std::vector<double> revisited_m;
  for (std::size_t k = 0; k < seen.map.size(); ++k) {
    if (!goes_on()) return found;
    if (!seen.map.localized(k)) continue;
    auto revisit = search.Revisit(k);
    if (!revisit) continue;
    found.push_back(*std::move(revisit));
    revisited_m.push_back(seen.map.travelled_m(k));
  }

  std::vector<SessionRelation> stretches;
  double next_m = 0.0;
  for (std::size_t k = 0; k < seen.map.size(); ++k) {
    const double here_m = seen.map.travelled_m(k);
    if (here_m < next_m || !seen.map.localized(k)) continue;
    const auto after = std::lower_bound(revisited_m.begin(), revisited_m.end(), here_m - kRevisitNearM);
    if (after != revisited_m.end() && *after <= here_m + kRevisitNearM) continue;
    next_m = here_m + options.loop.every_m;
    if (!goes_on()) return found;
    if (auto stretch = search.StretchSeenAgain(k)) stretches.push_back(*std::move(stretch));
  }
  for (const SessionRelation& one : stretches)
    if (std::ranges::any_of(stretches, [&](const SessionRelation& other) { return search.Confirm(one, other); }))
      found.push_back(one);
  return found;
}

}  // namespace cairn::slam
