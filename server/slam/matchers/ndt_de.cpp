#include "server/slam/matchers/ndt_de.h"

#include <limits>

#include "server/slam/features/scan_view.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, NdtSearchOptions& options) {
  visitor.Real("back_m", options.back_m, "m", 0.0, 20.0, "Farthest position searched behind the prior.");
  visitor.Real("ahead_m", options.ahead_m, "m", 0.0, 20.0, "Farthest position searched ahead of the prior.");
  visitor.Real("aside_m", options.aside_m, "m", 0.0, 20.0, "Farthest position searched to either side of the prior.");
  visitor.Real(
      "turn_rad", options.turn_rad, "rad", 0.0, kPi,
      "Largest turn searched to either side of the prior. A larger value finds faster turns, and more wrong answers.");
}

void Visit(OptionVisitor& visitor, NdtDeOptions& options) {
  visitor.Integer("seed", options.seed, "1", 0, std::numeric_limits<std::int64_t>::max(),
                  "Seed of the random numbers of every match.");
  visitor.Section("map", "The normal distributions.", [&] { Visit(visitor, options.map); });
  visitor.Section("thinning", "Thinning of the scan that is matched with them.",
                  [&] { Visit(visitor, options.thinning); });
  visitor.Section("search", "The space that is searched, along the axes of the robot.",
                  [&] { Visit(visitor, options.search); });
  visitor.Section("evolution", "Differential evolution. Its cost is a constant minus the score.",
                  [&] { Visit(visitor, options.evolution); });
  visitor.Flag("climb", options.climb, "Whether Newton's method follows the evolution.");
  visitor.Section("newton", "Newton's method.", [&] { Visit(visitor, options.newton); });
  visitor.Section("evidence", "When a match is accepted, and its covariance.",
                  [&] { Visit(visitor, options.evidence); });
}

NdtDeMatch SearchNdt(std::span<const Eigen::Vector2d> points_ref, std::span<const Eigen::Vector2d> points_curr,
                     const MatchPrior& prior, const NdtDeOptions& options, const ParallelFor& parallel_for) {
  NdtDeMatch match;
  const NdtMap map(points_ref, options.map);
  const std::vector<Eigen::Vector2d> points = ThinByCentreOfGravity(points_curr, options.thinning);
  match.T_evolved = prior.T_ref_curr;
  match.self_score = map.Score(ThinByCentreOfGravity(points_ref, options.thinning), Pose2{});
  match.fitness = match.self_score;
  if (map.empty() || points.size() < static_cast<std::size_t>(options.evidence.min_inliers)) {
    match.result = UnmatchedNdt(prior, MatchFailure::kTooFewFeatures);
    return match;
  }
  const NdtSearchOptions& search = options.search;
  const SearchBox box{{-search.back_m, -search.aside_m, -search.turn_rad},
                      {search.ahead_m, search.aside_m, search.turn_rad}};
  const auto pose_at = [&](const Eigen::Vector3d& x) { return prior.T_ref_curr * Pose2{x.x(), x.y(), x.z()}; };
  const auto fitness = [&](const Eigen::Vector3d& x) { return match.self_score - map.Score(points, pose_at(x)); };
  std::mt19937_64 engine(static_cast<std::uint64_t>(options.seed));
  const EvolutionResult evolved = Evolve(fitness, box, options.evolution, engine, parallel_for);
  match.fitness = evolved.cost;
  match.generations = evolved.generations;
  match.T_evolved = pose_at(evolved.best);
  Pose2 T_ref_curr = match.T_evolved;
  int iterations = evolved.generations;
  if (options.climb) {
    const NewtonResult climb = ClimbNdt(map, points, T_ref_curr, options.newton);
    T_ref_curr = climb.T_map_points;
    iterations += climb.iterations;
  }
  match.result = EvaluateNdtPose(map, points, T_ref_curr, true, prior, options.evidence);
  match.result.iterations = iterations;
  return match;
}

MatchResult MatchByDifferentialEvolution(const ScanView& ref, const ScanView& curr, const MatchPrior& prior,
                                         const NdtDeOptions& options, const ParallelFor& parallel_for) {
  return SearchNdt(PositionsOf(ref), PositionsOf(curr), prior, options, parallel_for).result;
}

}  // namespace cairn::slam
