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
constexpr double kMinRevisitScore = 0.6;   // Share of the points of the scan that must be explained.
constexpr double kRevisitSigmaRad = 0.02;  // Added to the heading of a match.
constexpr double kCorrectionM = 0.3;       // A revisit may correct the guess by so much, ...
constexpr double kCorrectionPerM = 0.03;   // ... and more with the way from the nearest tie.
constexpr int kMinRevisitPoints = 20;      // Points.

// Stretches.
constexpr double kRevisitNearM = 3.0;  // No stretch is compared within this way of a revisit.

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
               const SiteOptions& options)
      : known_(known), seen_(seen), ties_(ties), options_(options), align_(options.align) {
    align_.min_score = kMinRevisitScore;
  }

  // The guess of where keyframe `seen` lies relative to `known`.
  [[nodiscard]] Pose2 Guess(std::size_t known, std::size_t seen) const {
    return Between(known_.path[known], seen_.path[seen]);
  }

  // The way from the nearest tie to the two keyframes, along both sessions.
  [[nodiscard]] double WayFromTie(std::size_t known, std::size_t seen) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Tie& tie : ties_)
      least = std::min(least, std::abs(known_.map.travelled_m(tie.known) - known_.map.travelled_m(known)) +
                                  std::abs(seen_.map.travelled_m(tie.seen) - seen_.map.travelled_m(seen)));
    return least;
  }

  [[nodiscard]] std::optional<SessionRelation> Revisit(std::size_t seen) {
    const auto centre = NearestKeyframe(seen);
    if (!centre) return std::nullopt;
    const double way_m = WayFromTie(*centre, seen);
    if (way_m > kMaxRevisitWayM) return std::nullopt;
    BuildReference(*centre);
    const Pose2 guess = Guess(*centre, seen);
    const Trail& of_known = known_.map.trail();
    const Trail& of_seen = seen_.map.trail();
    const auto match = AlignPointsToSurfaces(*of_seen.points(seen), reference_,
                                             {guess, guess, PoseCovariance(kGuessSigmaM, kGuessSigmaRad)}, align_);
    if (!match.converged) return std::nullopt;
    const double corrected_m = (match.T_ref_curr.translation() - guess.translation()).norm();
    if (corrected_m > kCorrectionM + kCorrectionPerM * way_m) return std::nullopt;
    const VisibilityCounts counts =
        CompareBothWays(*of_known.keyframes()[*centre].scan, *of_known.points(*centre), *of_seen.keyframes()[seen].scan,
                        *of_seen.points(seen), match.T_ref_curr, options_.self_check.near_m);
    if (counts.known() < kMinRevisitPoints || counts.contradicted > options_.loop.max_conflict * counts.known())
      return std::nullopt;
    return SessionRelation{{known_.number, *centre},
                           {seen_.number, seen},
                           match.T_ref_curr,
                           match.covariance + PoseCovariance(options_.revisit.sigma_m, kRevisitSigmaRad)};
  }

  [[nodiscard]] std::optional<SessionRelation> StretchSeenAgain(std::size_t seen) const {
    const auto centre = LikeliestKeyframe(seen);
    if (!centre) return std::nullopt;
    const SearchWindow window = WindowAround(Guess(*centre, seen), WayFromTie(*centre, seen), options_.loop);
    const Trail& of_known = known_.map.trail();
    const Trail& of_seen = seen_.map.trail();
    const auto T_known_seen =
        MatchStretches(of_known, StretchAround(of_known.shapes(), *centre, kStretchM), of_seen,
                       StretchAround(of_seen.shapes(), seen, kHalfStretchM), window, options_.loop, options_.align);
    if (!T_known_seen) return std::nullopt;
    return SessionRelation{{known_.number, *centre},
                           {seen_.number, seen},
                           *T_known_seen,
                           PoseCovariance(options_.loop.sigma_m, kFoundSigmaRad)};
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
  // As for the revisits of one robot: near, and with a similar heading.
  [[nodiscard]] std::optional<std::size_t> NearestKeyframe(std::size_t seen) const {
    std::optional<std::size_t> nearest;
    double best = std::numeric_limits<double>::infinity();
    const Pose2& here = seen_.path[seen];
    const RevisitOptions& revisit = options_.revisit;
    ForEachNear(known_.path, known_.path.size(), here.translation(), revisit.max_distance_m,
                [&](std::size_t k, const Pose2& there) {
                  const double distance = (there.translation() - here.translation()).norm();
                  const double turn = std::abs(AngleDiff(there.theta, here.theta));
                  const double cost = distance + revisit.max_distance_m * turn / revisit.max_turn_rad;
                  if (distance > revisit.max_distance_m || turn > revisit.max_turn_rad) return;
                  if (!known_.map.localized(k) || cost >= best) return;
                  best = cost;
                  nearest = k;
                });
    return nearest;
  }

  // As for large loops: the least distance, measured by how uncertain it is.
  [[nodiscard]] std::optional<std::size_t> LikeliestKeyframe(std::size_t seen) const {
    constexpr std::size_t kStride = 4;
    std::optional<std::size_t> likeliest;
    double best = 1.0;
    const Pose2& here = seen_.path[seen];
    ForEachNear(known_.path, known_.path.size(), here.translation(), options_.loop.max_doubt_m,
                [&](std::size_t k, const Pose2& there) {
                  if (k % kStride != 0 || !known_.map.localized(k)) return;
                  const double away_m = (there.translation() - here.translation()).norm();
                  if (away_m >= options_.loop.max_doubt_m) return;
                  const double cost = away_m / WindowAround({}, WayFromTie(k, seen), options_.loop).reach_m;
                  if (cost >= best) return;
                  best = cost;
                  likeliest = k;
                });
    return likeliest;
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
};

}  // namespace

std::vector<std::size_t> PlacesToLookFor(const SessionMap& seen) {
  std::vector<std::size_t> places;
  if (seen.size() == 0) return places;
  const double every_m = std::max(kPlaceEveryM, seen.travelled_m(seen.size() - 1) / kMostSought);
  double next_m = 0.0;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    if (seen.travelled_m(k) < next_m || !seen.localized(k)) continue;
    next_m = seen.travelled_m(k) + every_m;
    places.push_back(k);
  }
  return places;
}

std::optional<SessionRelation> RecognisePlace(std::size_t known_number, SessionMap& known, std::size_t seen_number,
                                              SessionMap& seen, std::size_t keyframe, const LoopOptions& options) {
  const std::vector<RecentScan> scans = seen.ScansAround(keyframe, kHalfStretchM);
  if (WayOf(scans) < kShortestStretchM) return std::nullopt;
  const auto place = known.Find(scans);
  if (!place) return std::nullopt;
  const double score = known.ScoreAt(scans, place->T_map_robot);
  if (seen.FitsElsewhere(scans, scans.back().T_track_robot, options.max_rival * score)) return std::nullopt;
  const std::size_t nearest = known.NearestTo(place->T_map_robot);
  const std::size_t last = seen.NearestTo(scans.back().T_track_robot);
  return SessionRelation{{known_number, nearest},
                         {seen_number, last},
                         Between(known.own_path()[nearest], place->T_map_robot) *
                             Between(scans.back().T_track_robot, seen.own_path()[last]),
                         place->covariance};
}

std::vector<SessionRelation> FindRelationsNearby(const PlacedSession& known, const PlacedSession& seen,
                                                 std::span<const Tie> ties, const SiteOptions& options,
                                                 const GoOn& go_on) {
  Asking goes_on(go_on);
  NearbySearch search(known, seen, ties, options);
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
