#include "tests/studies/filters/consistency.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "server/slam/landmarks/innovation.h"
#include "server/slam/motion_models/motion_sampling.h"
#include "server/slam/random/resampling.h"
#include "tests/studies/filters/corner_world.h"

namespace cairn::studies {
namespace {

using slam::NormalDraw;

constexpr double kStepM = 0.25;
constexpr int kPointEvery = 8;  // Keyframes.
constexpr double kRoundM = 40.0;

// Corners inside and outside the loop; similar corners are never close to each other.
std::vector<Corner> Corners() {
  std::vector<Corner> corners;
  double turn = 0.0;
  const auto add = [&](double x, double y) {
    turn += 1.7;
    corners.push_back({{x, y}, WrapAngle(turn), corners.size() % 2 == 0 ? 1.5 : -1.5});
  };
  for (double x = -1.5; x < 14.0; x += 3.0) add(x, -1.6), add(x + 1.0, 9.7);
  for (double y = 0.5; y < 9.0; y += 3.0) add(-1.7, y), add(13.8, y + 1.0);
  add(3.0, 2.0), add(9.0, 2.4), add(3.3, 6.0), add(8.7, 5.8), add(6.0, 4.0);
  return corners;
}

std::vector<Pose2> TrueSteps(int rounds) {
  std::vector<Pose2> steps;
  for (int round = 0; round < rounds; ++round)
    for (const double side : {12.0, 8.0, 12.0, 8.0}) {
      for (double way = 0.0; way < side - 1e-9; way += kStepM) steps.push_back({kStepM, 0, 0});
      for (int i = 0; i < 4; ++i) steps.push_back({0, 0, kPi / 8});
    }
  return steps;
}

Eigen::Vector3d Draw(const Eigen::Matrix3d& covariance, slam::Rng& rng) {
  const Eigen::Vector3d unit = slam::ThreeNormalDraws(rng);
  return covariance.llt().matrixL() * unit;
}

std::size_t AncestryDepth(const slam::Filter& filter) {
  if (filter.hypothesis_count() <= 1) return 0;
  std::vector<slam::Hypothesis> all;
  for (std::size_t i = 1; i < filter.hypothesis_count(); ++i) all.push_back(filter.hypothesis(i));
  const std::size_t size = all.front().path.size();
  // Two paths that differ at one keyframe differ at all later ones, so the keyframes on which all paths agree come
  // first.
  std::size_t low = 0, high = size;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    const bool agree = std::all_of(
        all.begin(), all.end(), [&](const slam::Hypothesis& h) { return h.path[middle] == all.front().path[middle]; });
    (agree ? low : high) = agree ? middle + 1 : middle;
  }
  return size - low;
}

slam::FilterOptions Told(const ConsistencyOptions& options) {
  slam::FilterOptions told;
  told.particles = options.particles;
  told.back_end.drift = {0.002, 0.02, 0.005, 0.0005, 0.006, 0.01};
  told.back_end.landmarks.enabled = options.landmarks;
  told.back_end.landmarks.noise = {0.04, 0.01, 0.02};
  told.correction.min_travel_m = 12.0;
  // Old poses that are far apart make one error of their keyframes count several times: at 5 m the EKF states
  // too small an uncertainty (NEES 4.4).
  // (NEES 4.4).
  told.ekf.anchor_distance_m = 1.0;
  return told;
}

struct Sums {
  double nees = 0.0, nis = 0.0, effective = 0.0, depth = 0.0, error2 = 0.0;
  int nis_numbers = 0;
};

struct Run {
  std::vector<Sums> points;
  bool diverged = false;
  std::size_t landmarks = 0;
};

Run DriveOnce(const ConsistencyOptions& options, std::uint64_t seed) {
  const slam::FilterOptions told = Told(options);
  const auto filter = slam::MakeFilter(options.kind, told, {}, seed);
  slam::Rng rng(seed * 7919 + 13);
  const Eigen::Matrix3d revisit_covariance = Eigen::Vector3d(0.0025, 0.0025, 0.0001).asDiagonal();
  const Scan scan;
  const std::vector<Corner> corners = Corners();
  Run run;
  Sums since;
  Pose2 truth, track;
  std::vector<Pose2> path;
  std::vector<double> way;
  double travelled = 0.0;
  const auto keyframe = [&] {
    const slam::ScanView view = SeenCorners(corners, truth, told.back_end.landmarks.noise, options.noise_factor, rng);
    if (options.revisits) {
      std::ptrdiff_t nearest = -1;
      for (std::size_t k = 0; k < path.size() && travelled - way[k] > 12.0; ++k) {
        const Pose2 away = Between(path[k], truth);
        if (away.translation().norm() < 1.0 && std::abs(away.theta) < 1.0 &&
            (nearest < 0 ||
             away.translation().norm() < Between(path[static_cast<std::size_t>(nearest)], truth).translation().norm()))
          nearest = static_cast<std::ptrdiff_t>(k);
      }
      if (nearest >= 0) {
        const auto k = static_cast<std::size_t>(nearest);
        const Eigen::Vector3d z =
            Between(path[k], truth).vector() + options.noise_factor * Draw(revisit_covariance, rng);
        (void)filter->Observe(slam::RevisitObservation{k, {z.x(), z.y(), WrapAngle(z.z())}, revisit_covariance});
      }
    }
    filter->Observe({scan, view, track, travelled}, slam::SerialFor);
    filter->Commit();
    path.push_back(truth);
    way.push_back(travelled);
    const slam::FilterHealth health = filter->health();
    since.nis += health.nis;
    since.nis_numbers += health.nis_dimension;
  };
  keyframe();
  const std::vector<Pose2> steps = TrueSteps(options.rounds);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    // The filter gets the nominal step; the robot moves by this step with noise.
    const Pose2& step = steps[i];
    Pose2 made;
    if (options.kind == slam::FilterKind::kFastSlam1) {
      made = slam::SampleMotion({}, {step}, told.sampling, rng);
    } else {
      const Eigen::Vector3d d = options.noise_factor * Draw(told.back_end.drift.Covariance(step), rng);
      made = {step.x + d.x(), step.y + d.y(), WrapAngle(step.theta + d.z())};
    }
    truth = truth * made;
    track = track * step;
    travelled += step.translation().norm();
    filter->Predict({step});
    keyframe();
    if ((i + 1) % kPointEvery != 0) continue;
    const slam::FilterEstimate estimate = filter->estimate();
    Eigen::Vector3d error = truth.vector() - estimate.T_map_robot.vector();
    error.z() = WrapAngle(error.z());
    since.nees = error.dot(estimate.covariance.ldlt().solve(error));
    since.error2 = error.head<2>().squaredNorm();
    since.effective = filter->health().effective_sample_size;
    since.depth = static_cast<double>(AncestryDepth(*filter));
    run.points.push_back(since);
    since = {};
  }
  run.diverged = filter->health().diverged;
  run.landmarks = filter->landmarks().size();
  return run;
}

// 95 % bounds of the mean of the squares of `count` numbers.
void Bounds(double count, double& low, double& high) {
  if (!(count > 0.0)) return;
  low = slam::ChiSquareQuantile(0.025, count) / count;
  high = slam::ChiSquareQuantile(0.975, count) / count;
}

}  // namespace

std::size_t ConsistencyLandmarks() {
  return Corners().size();
}

ConsistencyResult StudyConsistency(const ConsistencyOptions& options) {
  ConsistencyResult result;
  std::vector<Sums> sums;
  for (int r = 0; r < options.runs; ++r) {
    const Run run = DriveOnce(options, options.first_seed + static_cast<std::uint64_t>(r));
    sums.resize(run.points.size());
    for (std::size_t p = 0; p < sums.size(); ++p) {
      sums[p].nees += run.points[p].nees;
      sums[p].nis += run.points[p].nis;
      sums[p].nis_numbers += run.points[p].nis_numbers;
      sums[p].effective += run.points[p].effective;
      sums[p].depth += run.points[p].depth;
      sums[p].error2 += run.points[p].error2;
    }
    result.diverged += run.diverged ? 1 : 0;
    result.landmarks = run.landmarks;
  }
  Bounds(3.0 * options.runs, result.nees_low, result.nees_high);
  result.nees_low *= 3.0;
  result.nees_high *= 3.0;
  const std::vector<Pose2> steps = TrueSteps(options.rounds);
  double travelled = 0.0, nis = 0.0;
  int nis_numbers = 0;
  std::size_t points_before = 0;
  for (std::size_t p = 0, i = 0; p < sums.size(); ++p) {
    for (; i < (p + 1) * kPointEvery; ++i) travelled += steps[i].translation().norm();
    ConsistencyPoint point;
    point.travelled_m = travelled;
    point.nees = sums[p].nees / options.runs;
    if (sums[p].nis_numbers > 0) point.nis_per_number = sums[p].nis / sums[p].nis_numbers;
    Bounds(sums[p].nis_numbers, point.nis_low, point.nis_high);
    point.effective_sample_size = sums[p].effective / options.runs;
    point.ancestry_depth = sums[p].depth / options.runs;
    point.position_error_m = std::sqrt(sums[p].error2 / options.runs);
    nis += sums[p].nis;
    nis_numbers += sums[p].nis_numbers;
    result.nees_mean += point.nees / static_cast<double>(sums.size());
    const bool before = travelled < kRoundM - kCornerSightM;
    (before ? result.nees_before : result.nees_after) += point.nees;
    points_before += before ? 1 : 0;
    if (point.nees >= result.nees_low && point.nees <= result.nees_high)
      result.nees_inside += 1.0 / static_cast<double>(sums.size());
    result.points.push_back(point);
  }
  result.nees_before /= static_cast<double>(std::max<std::size_t>(points_before, 1));
  result.nees_after /= static_cast<double>(std::max<std::size_t>(sums.size() - points_before, 1));
  if (nis_numbers > 0) result.nis_per_number = nis / nis_numbers;
  Bounds(nis_numbers, result.nis_low, result.nis_high);
  if (!result.points.empty()) result.position_error_m = result.points.back().position_error_m;
  return result;
}

}  // namespace cairn::studies
