#include "tests/studies/dpslam/grid_consistency.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>

#include "client/sim/shipped_worlds.h"
#include "client/sim/world.h"
#include "server/slam/dpslam/dpslam.h"
#include "server/slam/landmarks/innovation.h"
#include "tests/studies/scene.h"

namespace cairn::studies {
namespace {

constexpr double kStepM = 0.25, kMostTurn = 0.3;
constexpr int kPointEvery = 8;  // Steps.
constexpr double kRounds = 2.0;
constexpr slam::MotionNoise kWheels{0.004, 0.04, 0.02, 0.002, 0.02, 0.05};

// Drives round the room and turns on the spot at its corners.
std::vector<Pose2> TruePoses(const sim::Route& route) {
  std::vector<Pose2> poses;
  const double length = sim::ClosedLength(route.waypoints_map);
  for (double way = 0.0; way < kRounds * length; way += kStepM) {
    const sim::PathPlace place = sim::PlaceOnPath(route.waypoints_map, std::fmod(way, length));
    const Pose2 next{place.p_map.x(), place.p_map.y(), place.heading_rad};
    if (!poses.empty()) {
      const double turn = AngleDiff(next.theta, poses.back().theta);
      const int parts = static_cast<int>(std::ceil(std::abs(turn) / kMostTurn));
      for (int k = 1; k < parts; ++k) poses.push_back(poses.back() * Pose2{0.0, 0.0, turn / parts});
    }
    poses.push_back(next);
  }
  return poses;
}

Pose2 Erring(const Pose2& step, sim::Random& random) {
  const Eigen::Matrix3d L = kWheels.Covariance(step).llt().matrixL();
  const Eigen::Vector3d error =
      L * Eigen::Vector3d(sim::Normal(random, 1.0), sim::Normal(random, 1.0), sim::Normal(random, 1.0));
  return {step.x + error.x(), step.y + error.y(), WrapAngle(step.theta + error.z())};
}

double Nees(const slam::FilterEstimate& estimate, const Pose2& truth) {
  Eigen::Vector3d error = estimate.T_map_robot.vector() - truth.vector();
  error.z() = WrapAngle(error.z());
  return error.dot(estimate.covariance.ldlt().solve(error));
}

}  // namespace

GridConsistency StudyGridConsistency(const GridConsistencyOptions& options) {
  const Scene scene("room");
  const std::vector<Pose2> poses = TruePoses(sim::OpenWorld("room")->routes.front());
  sim::LaserOptions laser = Sick(0.02);
  laser.beams = 61;
  slam::DpSlamOptions dpslam;
  dpslam.hierarchical = options.hierarchical;
  dpslam.low.particles = dpslam.high.particles = options.particles;
  dpslam.low.drift = kWheels;
  dpslam.segment.length_m = 6.0;  // The room is small.

  GridConsistency result;
  for (int run = 0; run < options.runs; ++run) {
    const std::uint64_t seed = options.first_seed + static_cast<std::uint64_t>(run);
    sim::Random random(seed);
    slam::DpSlam filter(dpslam, poses.front(), seed);
    Pose2 odometry = poses.front();
    double travelled = 0.0;
    std::size_t point = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (i > 0) {
        const Pose2 step = Erring(Between(poses[i - 1], poses[i]), random);
        filter.Predict({step});
        odometry = odometry * step;
        travelled += step.translation().norm();
      }
      filter.Observe(std::make_shared<slam::LaserRays>(RaysOf(scene.Look(poses[i], laser, random), dpslam.opacity)),
                     slam::SerialFor);
      filter.Commit();
      if (i == 0 || i % kPointEvery != 0) continue;
      if (run == 0) result.points.emplace_back();
      GridConsistencyPoint& at = result.points[point++];
      const double share = 1.0 / options.runs;
      const auto off = [&](const Pose2& T) { return (T.translation() - poses[i].translation()).squaredNorm() * share; };
      at.travelled_m += travelled * share;
      at.nees += Nees(filter.estimate(), poses[i]) * share;
      at.effective_sample_size += filter.health().effective_sample_size * share;
      at.position_error_m += off(filter.estimate().T_map_robot);
      at.odometry_error_m += off(odometry);
    }
  }
  const double numbers = 3.0 * options.runs;
  result.nees_low = 3.0 * slam::ChiSquareQuantile(0.025, numbers) / numbers;
  result.nees_high = 3.0 * slam::ChiSquareQuantile(0.975, numbers) / numbers;
  for (GridConsistencyPoint& point : result.points) {
    point.position_error_m = std::sqrt(point.position_error_m);
    point.odometry_error_m = std::sqrt(point.odometry_error_m);
    result.nees_mean += point.nees / static_cast<double>(result.points.size());
  }
  return result;
}

}  // namespace cairn::studies
