// A robot driven round a building ring for the tests of DP-SLAM: true poses, odometry steps with errors, and
// scans.
#pragma once

#include <vector>

#include "client/sim/laser.h"
#include "client/sim/ray_caster.h"
#include "server/slam/parallel_for.h"
#include "tests/flat_world.h"

namespace cairn::slam {

struct DriveStep {
  Pose2 T_map_robot;
  Pose2 T_prev_curr;  // As odometry has it.
  Scan scan;
};

inline void AddBox(double x0, double y0, double x1, double y1, std::vector<sim::Segment>& segments) {
  const Eigen::Vector2d a(x0, y0), b(x1, y0), c(x1, y1), d(x0, y1);
  segments.insert(segments.end(), {{a, b}, {b, c}, {c, d}, {d, a}});
}

// A corridor 2 m wide round a core, with pillars on the way so that its length shows; counter-clockwise from
// (2, 1).
inline std::vector<DriveStep> DriveRing(double width, double height, double laps, int beams, std::uint64_t seed) {
  std::vector<sim::Segment> segments;
  AddBox(0, 0, width, height, segments);
  AddBox(2, 2, width - 2, height - 2, segments);
  for (double x = 3.0; x < width - 2.0; x += 2.7) AddBox(x, 0.0, x + 0.3, 0.25, segments);
  for (double x = 3.5; x < width - 2.0; x += 3.1) AddBox(x, height - 0.2, x + 0.4, height, segments);
  for (double y = 3.0; y < height - 2.0; y += 2.3) AddBox(0.0, y, 0.2, y + 0.3, segments);
  for (double y = 3.4; y < height - 2.0; y += 2.9) AddBox(width - 0.3, y, width, y + 0.3, segments);
  const sim::RayCaster walls(segments);

  // A rectangle of 1 m from the outer walls, driven with steps of 0.2 m and turns of 0.2 rad.
  std::vector<Pose2> poses{{2.0, 1.0, 0.0}};
  const double sides[] = {width - 2.0, height - 2.0, width - 2.0, height - 2.0};
  double left = laps * 2.0 * (width + height - 4.0), side_left = width - 3.0;
  for (int side = 0; left > 0.0;) {
    Pose2 pose = poses.back();
    if (side_left > 1e-9) {
      const double step = std::min(0.2, side_left);
      pose = pose * Pose2{step, 0.0, 0.0};
      side_left -= step, left -= step;
      poses.push_back(pose);
      continue;
    }
    for (int i = 1; i <= 8; ++i) poses.push_back(pose * Pose2{0.0, 0.0, i * kPi / 16});
    side_left = sides[++side % 4];
  }

  sim::Random random(seed);
  sim::LaserOptions laser;
  laser.beams = beams;
  laser.field_of_view_rad = kPi;
  laser.range_max_m = 8.0;
  std::vector<DriveStep> steps;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    Pose2 step = i > 0 ? Between(poses[i - 1], poses[i]) : Pose2{};
    const double way = step.translation().norm() + 0.2 * std::abs(step.theta);
    step = {step.x * 1.01 + sim::Normal(random, 0.03 * way), step.y + sim::Normal(random, 0.02 * way),
            step.theta * 1.01 + sim::Normal(random, 0.03 * way)};
    const auto stamp = static_cast<Stamp>(i) * 200'000'000;
    steps.push_back({poses[i], step, sim::MeasureFlatScan(walls, {}, poses[i], {}, stamp, laser, random)});
  }
  return steps;
}

// Runs the blocks in the calling thread, the last one first. With threads, any order is possible.
inline ParallelFor InBlocks(int blocks) {
  return [blocks](int count, const std::function<void(int, int)>& body) {
    for (int b = blocks - 1; b >= 0; --b)
      if (count * b / blocks < count * (b + 1) / blocks) body(count * b / blocks, count * (b + 1) / blocks);
  };
}

}  // namespace cairn::slam
