// What the benchmarks work on: keyframes of a drive, simulated or from a published log where that is at hand. Made once
// per process.
#pragma once

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "common/sensor/scan.h"
#include "server/slam/features/scan_view.h"

namespace cairn::bench {

struct BenchKeyframe {
  Scan scan;
  slam::ScanView view;
  Pose2 T_odom_robot;
};

struct BenchInput {
  std::string name;
  std::vector<BenchKeyframe> keyframes;  // At least 0.25 m or 0.2 rad apart; at most 150. Empty: the log is absent.
};

// 0: simulated building, 181 beams. 1: the same, 1081 beams over 270 deg. 2: intel. 3: mit-csail.
[[nodiscard]] const BenchInput& InputOf(std::int64_t index);

// One run per input.
inline void AllInputs(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgName("input")->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);
}

// The input of this run, its name as the run's label; nothing (and the run is skipped, saying so) where it is absent.
[[nodiscard]] const BenchInput* InputOf(benchmark::State& state);

}  // namespace cairn::bench
