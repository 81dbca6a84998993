// One step of FastSLAM 2.0 over a drive: predict, the keyframe's landmarks, commit; by number of particles.
#include <memory>

#include "server/slam/methods.h"
#include "tests/bench/bench_input.h"

namespace cairn::bench {
namespace {

void FastSlamStep(benchmark::State& state) {
  const BenchInput* input = InputOf(state);
  if (input == nullptr) return;
  slam::FilterOptions options;
  options.particles = state.range(1);
  std::unique_ptr<slam::Filter> filter;
  std::size_t k = 0;
  double travelled_m = 0.0;
  for (auto _ : state) {
    // The same drive again with a new filter: paths and maps would grow without bound.
    if (k + 1 >= input->keyframes.size() || filter == nullptr) {
      state.PauseTiming();
      filter = slam::MakeFilter(slam::FilterKind::kFastSlam2Points, options, {}, 1);
      k = 0;
      travelled_m = 0.0;
      state.ResumeTiming();
    }
    const BenchKeyframe &prev = input->keyframes[k], &curr = input->keyframes[k + 1];
    const Pose2 motion = Between(prev.T_odom_robot, curr.T_odom_robot);
    travelled_m += motion.translation().norm();
    filter->Predict({motion});
    filter->Observe(slam::KeyframeSight{curr.scan, curr.view, curr.T_odom_robot, travelled_m}, slam::SerialFor);
    filter->Commit();
    ++k;
  }
}
BENCHMARK(FastSlamStep)
    ->ArgNames({"input", "particles"})
    ->ArgsProduct({{0, 2, 3}, {50, 200, 450}})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace cairn::bench
