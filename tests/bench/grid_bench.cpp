// Drawing one scan into the occupancy grid, and copying a grid that shares its chunks.
#include "server/slam/grid/occupancy_grid.h"
#include "tests/bench/bench_input.h"

namespace cairn::bench {
namespace {

void OccupancyDraw(benchmark::State& state) {
  const BenchInput* input = InputOf(state);
  if (input == nullptr) return;
  slam::OccupancyGrid grid{slam::GridOptions{}};
  std::size_t next = 0;
  for (auto _ : state) {
    const BenchKeyframe& keyframe = input->keyframes[next++ % input->keyframes.size()];
    grid.Draw(keyframe.scan, keyframe.T_odom_robot);
  }
  state.counters["chunks"] = static_cast<double>(grid.chunk_count());
}
BENCHMARK(OccupancyDraw)->Apply(AllInputs);

// What a copy-on-write particle map pays for one scan: a shared copy and the chunks that scan touches.
void OccupancyShareAndDraw(benchmark::State& state) {
  const BenchInput* input = InputOf(state);
  if (input == nullptr) return;
  slam::OccupancyGrid grid{slam::GridOptions{}};
  for (const BenchKeyframe& keyframe : input->keyframes) grid.Draw(keyframe.scan, keyframe.T_odom_robot);
  std::size_t next = 0;
  for (auto _ : state) {
    const BenchKeyframe& keyframe = input->keyframes[next++ % input->keyframes.size()];
    slam::OccupancyGrid copy(grid.options(), grid.Share());
    copy.Draw(keyframe.scan, keyframe.T_odom_robot);
    benchmark::DoNotOptimize(copy);
  }
}
BENCHMARK(OccupancyShareAndDraw)->Apply(AllInputs);

}  // namespace
}  // namespace cairn::bench
