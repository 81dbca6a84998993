// Matching of neighbouring keyframes: from odometry's guess by voting over lines and by aligning points with lines, and
// without a guess by the evolution of thesis C.
#include "server/slam/matchers/icp.h"
#include "server/slam/matchers/ndt_de.h"
#include "server/slam/voting/voting.h"
#include "server/tools/log_run/over_threads.h"
#include "tests/bench/bench_input.h"

namespace cairn::bench {
namespace {

// Calls match(prev, curr, T_prev_curr by odometry) for one pair after the other.
template <typename Match>
void OverPairs(benchmark::State& state, const Match& match) {
  const BenchInput* input = InputOf(state);
  if (input == nullptr) return;
  std::size_t next = 0;
  for (auto _ : state) {
    const std::size_t k = next++ % (input->keyframes.size() - 1);
    const BenchKeyframe &prev = input->keyframes[k], &curr = input->keyframes[k + 1];
    benchmark::DoNotOptimize(match(prev.view, curr.view, Between(prev.T_odom_robot, curr.T_odom_robot)));
  }
}

void Voting(benchmark::State& state) {
  const slam::VotingOptions options;
  OverPairs(state, [&](const slam::ScanView& prev, const slam::ScanView& curr, const Pose2& odometry) {
    return slam::MatchByVoting(prev.features, curr.features, odometry, options);
  });
}
BENCHMARK(Voting)->Apply(AllInputs);

// With the index over the previous scan, which is made anew for every pair.
void PointToLine(benchmark::State& state) {
  const slam::PointToLineOptions options;
  OverPairs(state, [&](const slam::ScanView& prev, const slam::ScanView& curr, const Pose2& odometry) {
    return slam::MatchByIcp(prev, curr, {odometry, Eigen::Vector3d(0.01, 0.01, 0.005).asDiagonal()}, options);
  });
}
BENCHMARK(PointToLine)->Apply(AllInputs);

// Population 100, 50 generations, none of them saved by a stop rule.
void Evolution(benchmark::State& state, std::int64_t threads) {
  const slam::ParallelFor parallel_for = server::OverThreads(threads);
  const slam::NdtDeOptions options;
  OverPairs(state, [&](const slam::ScanView& prev, const slam::ScanView& curr, const Pose2& /*odometry*/) {
    return slam::MatchByDifferentialEvolution(prev, curr, {{}, Eigen::Vector3d(1e4, 1e4, 1e2).asDiagonal()}, options,
                                              parallel_for);
  });
}
BENCHMARK_CAPTURE(Evolution, one_thread, 1)->Apply(AllInputs)->UseRealTime();
BENCHMARK_CAPTURE(Evolution, two_threads, 2)->Apply(AllInputs)->UseRealTime();

}  // namespace
}  // namespace cairn::bench
