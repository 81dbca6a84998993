#include "server/slam/matching/revisit_search.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

// The old keyframe that shows most likely what the robot sees: near, and looking the same way.
std::optional<std::size_t> NearestKeyframe(const Hypothesis& belief, const std::vector<KeyframeShape>& keyframes,
                                           std::span<const double> distances_m, double travelled_m,
                                           const RevisitOptions& options) {
  std::optional<std::size_t> nearest;
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (travelled_m - keyframes[k].travelled_m < options.min_travel_m) break;
    if (distances_m[k] > options.max_way_m) continue;
    const Pose2& T_map_k = belief.path[k];
    const double distance = (T_map_k.translation() - belief.T_map_robot.translation()).norm();
    if (distance > options.max_distance_m) continue;
    const double turn = std::abs(AngleDiff(T_map_k.theta, belief.T_map_robot.theta));
    if (turn > options.max_turn_rad) continue;
    const double cost = distance + options.max_distance_m * turn / options.max_turn_rad;
    if (cost < best) {
      best = cost;
      nearest = k;
    }
  }
  return nearest;
}

}  // namespace

void Visit(OptionVisitor& visitor, RevisitOptions& options) {
  visitor.Flag("enabled", options.enabled, "Match scans with places seen before.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Between two sightings of a place; less: it is still the same visit.");
  visitor.Real("max_way_m", options.max_way_m, "m", 0.0, 1e9,
               "Along what is known, between here and there; beyond, a large loop has to be found first.");
  visitor.Real("max_distance_m", options.max_distance_m, "m", 0.1, 20.0, "Between the robot and the old keyframe.");
  visitor.Real("max_turn_rad", options.max_turn_rad, "rad", 0.05, 3.2, "Between their headings.");
  visitor.Integer("neighbours", options.neighbours, "1", 0, 100, "Keyframes on either side whose surfaces are added.");
  visitor.Integer("guesses", options.guesses, "1", 0, 100, "Particles tried where the best one's belief fails.");
  visitor.Real("guess_sigma_m", options.guess_sigma_m, "m", 0.01, 10.0, "How far the match may pull from a guess.");
  visitor.Real("guess_sigma_rad", options.guess_sigma_rad, "rad", 0.001, 3.2, "See guess_sigma_m.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Share of the scan that must be explained.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.0, 5.0, "Added to the match's own uncertainty.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.0, 1.0, "See sigma_m.");
}

RevisitSearch::RevisitSearch(const RevisitOptions& options, const PointToLineOptions& align)
    : options_(options), align_(align), reference_(align.first_pair_distance_m) {
  align_.min_score = options.min_score;
}

std::optional<RevisitObservation> RevisitSearch::Find(std::span<const SurfacePoint> points_robot,
                                                      const std::vector<KeyframeShape>& keyframes,
                                                      std::span<const double> distances_m, double travelled_m,
                                                      const Filter& filter, const ParallelFor& parallel_for) {
  if (!options_.enabled) return std::nullopt;
  const Hypothesis best = filter.hypothesis(0);
  const std::optional<std::size_t> centre = NearestKeyframe(best, keyframes, distances_m, travelled_m, options_);
  if (!centre) return std::nullopt;
  BuildReference(keyframes, *centre);
  const Eigen::Matrix3d prior =
      Eigen::Vector3d(options_.guess_sigma_m * options_.guess_sigma_m, options_.guess_sigma_m * options_.guess_sigma_m,
                      options_.guess_sigma_rad * options_.guess_sigma_rad)
          .asDiagonal();
  const auto align = [&](const Hypothesis& belief) {
    const Pose2 guess = Between(belief.path[*centre], belief.T_map_robot);
    return AlignPointsToSurfaces(points_robot, reference_, {guess, guess, prior}, align_);
  };
  MatchResult match = align(best);
  if (!match.converged) match = AlignFromOthers(filter, align, parallel_for);
  if (!match.converged) return std::nullopt;
  RevisitObservation revisit{*centre, match.T_prev_curr, match.covariance};
  revisit.covariance.diagonal() +=
      Eigen::Vector3d(options_.sigma_m * options_.sigma_m, options_.sigma_m * options_.sigma_m,
                      options_.sigma_rad * options_.sigma_rad);
  return revisit;
}

// Tries hypotheses spread over the belief; the one that explains most wins.
MatchResult RevisitSearch::AlignFromOthers(const Filter& filter,
                                           const std::function<MatchResult(const Hypothesis&)>& align,
                                           const ParallelFor& parallel_for) const {
  const std::size_t size = filter.hypothesis_count() - 1;  // Besides the best.
  const std::size_t guesses = std::min(size, static_cast<std::size_t>(options_.guesses));
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

void RevisitSearch::BuildReference(const std::vector<KeyframeShape>& keyframes, std::size_t centre) {
  reference_.Clear();
  const auto reach = static_cast<std::size_t>(options_.neighbours);
  const std::size_t first = centre > reach ? centre - reach : 0;
  const std::size_t last = std::min(keyframes.size() - 1, centre + reach);
  for (std::size_t k = first; k <= last; ++k) {
    const Pose2 T_centre_k = Between(keyframes[centre].T_track_robot, keyframes[k].T_track_robot);
    const Eigen::Matrix2d R = T_centre_k.rotation();
    for (const SurfacePoint& point : keyframes[k].points)
      reference_.Add({R * point.p + T_centre_k.translation(), R * point.normal});
  }
}

}  // namespace cairn::slam
