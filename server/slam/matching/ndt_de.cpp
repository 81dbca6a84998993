#include "server/slam/matching/ndt_de.h"

#include <limits>

#include "server/slam/matching/scan_points.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, NdtSearchOptions& options) {
  visitor.Real("back_m", options.back_m, "m", 0.0, 20.0, "Farthest back from where the robot is expected.");
  visitor.Real("ahead_m", options.ahead_m, "m", 0.0, 20.0, "Farthest ahead.");
  visitor.Real("aside_m", options.aside_m, "m", 0.0, 20.0, "Farthest to either side.");
  visitor.Real("turn_rad", options.turn_rad, "rad", 0.0, kPi, "Farthest turn either way.");
}

void Visit(OptionVisitor& visitor, NdtDeOptions& options) {
  visitor.Integer("seed", options.seed, "1", 0, std::numeric_limits<std::int64_t>::max(), "Of every match's engine.");
  visitor.Section("map", "The distributions.", [&] { Visit(visitor, options.map); });
  visitor.Section("thinning", "Of the scan laid on them.", [&] { Visit(visitor, options.thinning); });
  visitor.Section("search", "The space searched, in the robot's axes around the prior.",
                  [&] { Visit(visitor, options.search); });
  visitor.Section("evolution", "Differential evolution; its cost is A minus the score.",
                  [&] { Visit(visitor, options.evolution); });
  visitor.Flag("climb", options.climb, "Newton's algorithm after the evolution.");
  visitor.Section("newton", "The climb.", [&] { Visit(visitor, options.newton); });
  visitor.Section("evidence", "When the answer counts, and how sure it is.", [&] { Visit(visitor, options.evidence); });
}

NdtDeMatch SearchNdt(std::span<const Eigen::Vector2d> points_prev, std::span<const Eigen::Vector2d> points_curr,
                     const MatchPrior& prior, const NdtDeOptions& options, const ParallelFor& parallel_for) {
  NdtDeMatch match;
  const NdtMap map(points_prev, options.map);
  const std::vector<Eigen::Vector2d> points = ThinByCentreOfGravity(points_curr, options.thinning);
  match.T_evolved = prior.T_prev_curr;
  match.self_score = map.Score(ThinByCentreOfGravity(points_prev, options.thinning), Pose2{});
  match.fitness = match.self_score;
  if (map.empty() || points.size() < static_cast<std::size_t>(options.evidence.min_inliers)) {
    match.result = UnmatchedNdt(prior, MatchFailure::kTooFewFeatures);
    return match;
  }
  const NdtSearchOptions& search = options.search;
  const SearchBox box{{-search.back_m, -search.aside_m, -search.turn_rad},
                      {search.ahead_m, search.aside_m, search.turn_rad}};
  const auto pose_at = [&](const Eigen::Vector3d& x) { return prior.T_prev_curr * Pose2{x.x(), x.y(), x.z()}; };
  const auto fitness = [&](const Eigen::Vector3d& x) { return match.self_score - map.Score(points, pose_at(x)); };
  std::mt19937_64 engine(static_cast<std::uint64_t>(options.seed));
  const EvolutionResult evolved = Evolve(fitness, box, options.evolution, engine, parallel_for);
  match.fitness = evolved.cost;
  match.generations = evolved.generations;
  match.T_evolved = pose_at(evolved.best);
  Pose2 T_prev_curr = match.T_evolved;
  int iterations = evolved.generations;
  if (options.climb) {
    const NewtonResult climb = ClimbNdt(map, points, T_prev_curr, options.newton);
    T_prev_curr = climb.T_map_points;
    iterations += climb.iterations;
  }
  match.result = JudgeNdtPose(map, points, T_prev_curr, true, prior, options.evidence);
  match.result.iterations = iterations;
  return match;
}

MatchResult MatchByDifferentialEvolution(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                                         const NdtDeOptions& options, const ParallelFor& parallel_for) {
  return SearchNdt(PositionsOf(prev), PositionsOf(curr), prior, options, parallel_for).result;
}

}  // namespace cairn::slam
