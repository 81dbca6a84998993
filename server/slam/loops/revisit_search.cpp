#include "server/slam/loops/revisit_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

// Half or twice of each of these changes the errors no more than another seed (study `sensitivity`).
constexpr double kMinRevisitTravelM = 12.0;  // After a shorter way it is still the same visit of a place.
constexpr std::size_t kGuesses = 6;          // Further particles whose poses are tried if that of the best one fails.
constexpr double kGuessSigmaM = 0.5;         // Standard deviation of the position of a guess.
constexpr double kGuessSigmaRad = 0.15;      // Standard deviation of its heading.
constexpr double kMinRevisitScore = 0.6;     // Share of the points of the scan that must be explained.
// Where a smaller share is explained after so many iterations, the alignment is given up. On the three logs of the
// benchmark all matches had more than kMinRevisitScore by then, and two thirds to five sixths of the others less than
// this.
constexpr double kHopelessScore = 0.55;
constexpr int kSettling = 2;
constexpr double kRevisitSigmaRad = 0.02;  // Standard deviation that is added to the heading of a match.
constexpr double kAlikeM = 2.0;            // Way on which matches have the same errors.
constexpr double kOpenSigmaM = 100.0;      // Standard deviation of a position that the scan does not show at all.

// The old keyframe that most likely shows the same surroundings: near, and with a similar heading.
std::optional<std::size_t> NearestKeyframe(const Pose2& T_map_robot, const PathIndex& index, const Trail& trail,
                                           double travelled_m, const RevisitOptions& options) {
  std::optional<std::size_t> nearest;
  double best = std::numeric_limits<double>::infinity();
  const Eigen::Vector2d here = T_map_robot.translation();
  const std::size_t end = CountBefore(trail.shapes(), travelled_m, kMinRevisitTravelM);
  const auto look = [&](std::size_t k, const Pose2& T_map_k) {
    if (k >= end) return;
    const double distance = (T_map_k.translation() - here).norm();
    if (distance > options.max_distance_m) return;
    const double turn = std::abs(AngleDiff(T_map_k.theta, T_map_robot.theta));
    if (turn > options.max_turn_rad) return;
    const double cost = distance + options.max_distance_m * turn / options.max_turn_rad;
    const bool better = cost < best || (cost == best && nearest && k < *nearest);
    if (!better || trail.IsFarther(k, kLargeLoopM)) return;
    best = cost;
    nearest = k;
  };
  // No keyframe costs less than its distance.
  const auto go_on = [&best](double distance_m) { return distance_m <= best; };
  index.ForEachFrom(here, options.max_distance_m, go_on, look);
  return nearest;
}

// Along a corridor the match stays where the guess was, which is a particle's own belief: it must not count once more
// as something that was measured.
Eigen::Matrix2d UnseenAlong(const MatchResult& match) {
  const double variance = 1.0 / std::max(match.open_information, 1.0 / (kOpenSigmaM * kOpenSigmaM));
  return variance * match.degenerate_direction * match.degenerate_direction.transpose();
}

}  // namespace

void Visit(OptionVisitor& visitor, RevisitOptions& options) {
  visitor.Flag("enabled", options.enabled, "Whether scans are matched with places that were seen before.");
  visitor.Real("max_distance_m", options.max_distance_m, "m", 0.1, 20.0,
               "Largest distance between the robot and an old keyframe.");
  visitor.Real("max_turn_rad", options.max_turn_rad, "rad", 0.05, 3.2,
               "Largest difference between the headings of the robot and of an old keyframe.");
  visitor.Integer("neighbours", options.neighbours, "1", 0, 100,
                  "Number of keyframes before and after the old one whose surfaces are used as well.");
  visitor.Real(
      "sigma_m", options.sigma_m, "m", 0.0, 5.0,
      "Standard deviation that is added to the position of a match, because neighbouring matches have similar errors. "
      "A larger value trusts a single match less.");
}

RevisitSearch::RevisitSearch(const RevisitOptions& options, const PointToLineOptions& align)
    : options_(options), align_(align) {
  align_.min_score = kMinRevisitScore;
}

std::optional<RevisitObservation> RevisitSearch::Find(std::span<const SurfacePoint> points_robot, const Trail& trail,
                                                      double travelled_m, const Filter& filter, const PathIndex& index,
                                                      const ParallelFor& parallel_for) {
  if (!options_.enabled) return std::nullopt;
  const Hypothesis best = filter.hypothesis(0);
  const std::optional<std::size_t> centre = NearestKeyframe(best.T_map_robot, index, trail, travelled_m, options_);
  if (!centre) return std::nullopt;
  BuildReference(trail, *centre);
  const Eigen::Matrix3d prior = PoseCovariance(kGuessSigmaM, kGuessSigmaRad);
  const auto align = [&](const Hypothesis& belief) {
    const Pose2 guess = Between(belief.path[*centre], belief.T_map_robot);
    return AlignPointsToSurfaces(points_robot, reference_, {guess, guess, prior, kHopelessScore, kSettling}, align_);
  };
  MatchResult match = align(best);
  if (!match.converged) match = AlignFromOthers(filter, align, parallel_for);
  if (!match.converged) return std::nullopt;
  // Neighbouring matches have similar errors.
  Eigen::Matrix3d covariance = match.covariance + PoseCovariance(options_.sigma_m, kRevisitSigmaRad);
  if (match.degenerate) covariance.topLeftCorner<2, 2>() += UnseenAlong(match);
  return RevisitObservation{*centre, match.T_ref_curr, covariance, trail.RevisitsWithin(kAlikeM, travelled_m)};
}

// Aligns with other hypotheses of the filter, and returns the result that explains most.
MatchResult RevisitSearch::AlignFromOthers(const Filter& filter,
                                           const std::function<MatchResult(const Hypothesis&)>& align,
                                           const ParallelFor& parallel_for) const {
  const std::size_t size = filter.hypothesis_count() - 1;  // Hypotheses other than the best.
  const std::size_t guesses = std::min(size, kGuesses);
  std::vector<MatchResult> matches(guesses);
  parallel_for(static_cast<int>(guesses), [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto guess = static_cast<std::size_t>(i);
      matches[guess] = align(filter.hypothesis(1 + guess * size / guesses));
    }
  });
  MatchResult best;
  for (const MatchResult& match : matches)
    if (match.converged && (!best.converged || match.score > best.score)) best = match;
  return best;
}

void RevisitSearch::BuildReference(const Trail& trail, std::size_t centre) {
  reference_.Clear();
  const Stretch around = NeighboursOf(trail.shapes(), centre, static_cast<std::size_t>(options_.neighbours));
  ForEachSurface(trail, around, [&](const SurfacePoint& surface) { reference_.Add(surface); });
}

}  // namespace cairn::slam
