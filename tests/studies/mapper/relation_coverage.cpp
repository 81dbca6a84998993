#include "tests/studies/mapper/relation_coverage.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "common/geometry/pose_difference.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/scan/surface_points.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/mapper/path_errors.h"

namespace cairn::studies {
namespace {

constexpr int kSamples = 300;
constexpr Stamp kSameScan = 50'000'000;  // A relation names the stamps of scans, rounded.

// The element of `stamped` whose stamp is the nearest, if it is near enough. REQUIRES: in the order of the stamps.
template <typename Stamped>
const Stamped* AtStamp(const std::vector<Stamped>& stamped, Stamp stamp) {
  const auto after =
      std::ranges::lower_bound(stamped, stamp, std::ranges::less{}, [](const Stamped& one) { return one.stamp; });
  const Stamped* nearest = nullptr;
  const auto consider = [&](const Stamped& one) {
    if (std::abs(one.stamp - stamp) > kSameScan) return;
    if (nearest == nullptr || std::abs(one.stamp - stamp) < std::abs(nearest->stamp - stamp)) nearest = &one;
  };
  if (after != stamped.end()) consider(*after);
  if (after != stamped.begin()) consider(*(after - 1));
  return nearest;
}

class Coverage {
 public:
  explicit Coverage(const RelationNoise& noise) : noise_(PoseCovariance(noise.sigma_m, noise.sigma_rad)) {}
  void Add(const Pose2& T_from_to, const Eigen::Matrix3d& covariance, const Pose2& T_from_to_true) {
    const Eigen::Vector3d error = Minus(T_from_to, T_from_to_true);
    const Eigen::Matrix3d P = covariance + noise_;
    nees_.push_back(error.dot(P.ldlt().solve(error)));
    position_nees_ += error.head<2>().dot(P.topLeftCorner<2, 2>().inverse() * error.head<2>());
    heading_nees_ += error.z() * error.z() / P(2, 2);
  }
  [[nodiscard]] RelationCoverage result() {
    RelationCoverage result;
    result.compared = nees_.size();
    if (nees_.empty()) return result;
    const double share = 1.0 / static_cast<double>(nees_.size()), inside = slam::ChiSquareQuantile(0.95, 3.0);
    for (const double nees : nees_) {
      result.nees += share * nees;
      result.inside += nees <= inside ? share : 0.0;
    }
    result.position_nees = share * position_nees_;
    result.heading_nees = share * heading_nees_;
    std::ranges::sort(nees_);
    result.nees_median = nees_[nees_.size() / 2];
    return result;
  }

 private:
  Eigen::Matrix3d noise_;
  std::vector<double> nees_;
  double position_nees_ = 0.0, heading_nees_ = 0.0;
};

}  // namespace

RelationNoise RelationNoiseOf(const StudyLog& log) {
  struct StampedScan {
    Stamp stamp;
    const Scan* scan;
  };
  std::vector<StampedScan> scans;
  for (const LogRecord& record : log.records)
    if (const auto* const scan = std::get_if<Scan>(&record)) scans.push_back({scan->stamp, scan});
  double metres = 0.0, radians = 0.0, compared = 0.0;
  for (const Relation& relation : log.relations) {
    const StampedScan *from = AtStamp(scans, relation.from), *to = AtStamp(scans, relation.to);
    if (from == nullptr || to == nullptr) continue;
    const auto points = [](const Scan& scan) { return slam::SurfacePointsOf(slam::PointsOf(scan), scan, {}); };
    const slam::PointIndex reference(points(*from->scan));
    const slam::MatchResult match = slam::AlignPointsToSurfaces(
        points(*to->scan), reference, {relation.T_from_to, relation.T_from_to, PoseCovariance(0.5, 0.15)}, {});
    if (!match.converged || match.degenerate) continue;
    const Eigen::Vector3d apart = Minus(match.T_ref_curr, relation.T_from_to);
    metres += apart.head<2>().norm();
    radians += std::abs(apart.z());
    compared += 1.0;
  }
  if (compared == 0.0) return {};
  // The mean of a distance in the plane is sqrt(pi / 2) standard deviations of each axis, that of the size of an angle
  // sqrt(2 / pi).
  return {metres / compared / std::sqrt(kPi / 2.0), radians / compared / std::sqrt(2.0 / kPi)};
}

RelationCoverage CoverageOfSmoothed(const LogRun& run, const StudyLog& log, const RelationNoise& noise) {
  const slam::MapperSnapshot& snapshot = run.snapshot;
  const std::vector<Pose2> path = slam::SmoothedPath(snapshot);
  slam::Rng rng(1);
  const auto errors = SamplePathErrors(path, snapshot.relations, kSamples, rng);
  Coverage coverage(noise);
  using Place = slam::MapperSnapshot::ScanPlace;
  const auto pose = [&](const Place& place) { return path[place.keyframe] * place.T_keyframe_robot; };
  const auto errors_of = [&](const Place& place) -> PoseErrorSamples {
    return J_compose_left(path[place.keyframe], place.T_keyframe_robot).cast<float>() * errors[place.keyframe];
  };
  for (const Relation& relation : log.relations) {
    const Place *from = AtStamp(snapshot.scans, relation.from), *to = AtStamp(snapshot.scans, relation.to);
    if (from == nullptr || to == nullptr) continue;
    const Pose2 T_map_from = pose(*from), T_map_to = pose(*to);
    coverage.Add(Between(T_map_from, T_map_to),
                 RelativeCovariance(T_map_from, errors_of(*from), T_map_to, errors_of(*to)), relation.T_from_to);
  }
  return coverage.result();
}

RelationCoverage CoverageOfSteps(const LogRun& run, const StudyLog& log, const RelationNoise& noise) {
  const slam::MapperSnapshot& snapshot = run.snapshot;
  std::vector<const slam::PoseRelation*> steps(snapshot.keyframes.size(), nullptr);
  for (const slam::PoseRelation& relation : snapshot.relations)
    if (!relation.loop && relation.to == relation.from + 1) steps[relation.to] = &relation;
  Coverage coverage(noise);
  for (const Relation& relation : log.relations) {
    const auto *from = AtStamp(snapshot.scans, relation.from), *to = AtStamp(snapshot.scans, relation.to);
    if (from == nullptr || to == nullptr || from->keyframe > to->keyframe) continue;
    Pose2 T_from_to = from->T_keyframe_robot.Inverse();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    double way_m = 0.0;
    for (std::size_t k = from->keyframe + 1; k <= to->keyframe && way_m <= kStepsWithinM; ++k) {
      if (steps[k] == nullptr) way_m = 2.0 * kStepsWithinM;
      if (steps[k] == nullptr) break;
      const Pose2& step = steps[k]->T_from_to;
      const Eigen::Matrix3d J_before = J_compose_left(T_from_to, step), J_step = J_compose_right(T_from_to, step);
      covariance = J_before * covariance * J_before.transpose() + J_step * steps[k]->covariance * J_step.transpose();
      T_from_to = T_from_to * step;
      way_m += step.translation().norm();
    }
    if (way_m > kStepsWithinM) continue;
    const Eigen::Matrix3d J = J_compose_left(T_from_to, to->T_keyframe_robot);
    coverage.Add(T_from_to * to->T_keyframe_robot, J * covariance * J.transpose(), relation.T_from_to);
  }
  return coverage.result();
}

RelationCoverage CoverageOfOnline(const LogRun& run, const StudyLog& log, const RelationNoise& noise) {
  Coverage coverage(noise);
  for (const Relation& relation : log.relations) {
    const StampedPose *from = AtStamp(run.online, relation.from), *to = AtStamp(run.online, relation.to);
    if (from == nullptr || to == nullptr) continue;
    const Pose2 &T_map_from = from->T_map_robot, &T_map_to = to->T_map_robot, T_from_map = T_map_from.Inverse();
    const Eigen::Matrix3d J_from = J_compose_left(T_from_map, T_map_to) * J_inverse(T_map_from);
    const Eigen::Matrix3d J_to = J_compose_right(T_from_map, T_map_to);
    const auto covariance = [&](const StampedPose* at) {
      return run.covariances[static_cast<std::size_t>(at - run.online.data())];
    };
    coverage.Add(Between(T_map_from, T_map_to),
                 J_from * covariance(from) * J_from.transpose() + J_to * covariance(to) * J_to.transpose(),
                 relation.T_from_to);
  }
  return coverage.result();
}

}  // namespace cairn::studies
