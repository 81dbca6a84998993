// Snapshots of robots that drive through one world, for tests of the joint smoothing: made directly, without an
// estimator.
#pragma once

#include <memory>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "server/slam/mapper_options.h"
#include "server/slam/site/site_smoothing.h"
#include "server/slam/site_options_of.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam::test {

// A robot's own map begins at `T_own_start`, wherever the robot stands in the world. Its path turns a little too far
// with every metre.
struct RobotDrive {
  MapperSnapshot snapshot;
  std::vector<Pose2> truth;  // T_world_robot.
};

inline RobotDrive DriveThrough(const World& world, const Pose2& T_world_start, std::span<const Pose2> steps,
                               const Pose2& T_own_start, std::uint64_t seed, double drift_rad_per_m = 0.0002,
                               const Laser& laser = {.first_rad = -kPi / 2, .range_max_m = 12.0, .sigma_m = 0.01}) {
  RobotDrive drive;
  std::mt19937_64 rng(seed);
  Pose2 truth = T_world_start, own = T_own_start;
  const auto look = [&] {
    Scan scan = Look(world, truth, laser, &rng);
    scan.stamp = static_cast<Stamp>(drive.truth.size() + 1) * 100'000'000;
    drive.snapshot.scans.push_back({scan.stamp, drive.truth.size(), {}});
    drive.snapshot.keyframes.push_back({std::make_shared<const Scan>(std::move(scan)), own});
    drive.snapshot.online_path.push_back(own);
    drive.snapshot.full_path.push_back(own);
    drive.truth.push_back(truth);
  };
  look();
  for (const Pose2& step : steps) {
    truth = truth * step;
    own = own * step * Pose2{0.0, 0.0, drift_rad_per_m * step.translation().norm()};
    look();
  }
  return drive;
}

// `metres` of the way round the ring, from `from_m` on.
inline RobotDrive DriveRing(const World& world, double from_m, double metres, const Pose2& T_own_start,
                            std::uint64_t seed) {
  constexpr double kStepM = 0.4;
  const std::vector<Pose2> before = RingSteps(from_m, kStepM);
  const std::vector<Pose2> all = RingSteps(from_m + metres, kStepM);
  Pose2 T_world_start;
  for (const Pose2& step : before) T_world_start = T_world_start * step;
  return DriveThrough(world, T_world_start, std::span(all).subspan(before.size()), T_own_start, seed);
}

// The snapshot as it was after so many keyframes.
inline MapperSnapshot FirstOf(MapperSnapshot snapshot, std::size_t keyframes) {
  snapshot.keyframes.resize(keyframes);
  snapshot.online_path.resize(keyframes);
  snapshot.full_path.resize(keyframes);
  return snapshot;
}

// The largest distance between where two robots lie relative to each other, and where they truly do.
inline double ErrorBetween(const RobotDrive& a, const std::vector<Pose2>& path_a, const RobotDrive& b,
                           const std::vector<Pose2>& path_b) {
  double most = 0.0;
  for (std::size_t i = 0; i < path_a.size(); i += 20) {
    for (std::size_t k = 0; k < path_b.size(); k += 20) {
      const Pose2 truth = Between(a.truth[i], b.truth[k]);
      most = std::max(most, (Between(path_a[i], path_b[k]).translation() - truth.translation()).norm());
    }
  }
  return most;
}

}  // namespace cairn::slam::test
