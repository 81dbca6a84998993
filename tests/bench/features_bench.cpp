// Lines, corners and patterns of one scan; and its surface points.
#include "server/slam/features/feature_extraction.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan/surface_points.h"
#include "tests/bench/bench_input.h"

namespace cairn::bench {
namespace {

void Features(benchmark::State& state) {
  const BenchInput* input = InputOf(state);
  if (input == nullptr) return;
  std::size_t next = 0;
  for (auto _ : state) {
    const Scan& scan = input->keyframes[next++ % input->keyframes.size()].scan;
    benchmark::DoNotOptimize(slam::ExtractFeatures(scan, slam::FeatureOptions{}));
  }
}
BENCHMARK(Features)->Apply(AllInputs);

void SurfacePoints(benchmark::State& state) {
  const BenchInput* input = InputOf(state);
  if (input == nullptr) return;
  std::size_t next = 0;
  for (auto _ : state) {
    const Scan& scan = input->keyframes[next++ % input->keyframes.size()].scan;
    benchmark::DoNotOptimize(slam::SurfacePointsOf(slam::PointsOf(scan), scan, slam::SurfaceOptions{}));
  }
}
BENCHMARK(SurfacePoints)->Apply(AllInputs);

}  // namespace
}  // namespace cairn::bench
