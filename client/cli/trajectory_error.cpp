#include "client/cli/trajectory_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "client/cli/percentiles.h"

namespace cairn::client {
namespace {

struct Pair {
  Pose2 estimate;
  Pose2 truth;
};

// The rigid motion that brings the estimate's positions nearest to the truth's, in the mean of squares.
Pose2 BestFit(const std::vector<Pair>& pairs) {
  Eigen::Vector2d mean_e = Eigen::Vector2d::Zero(), mean_t = Eigen::Vector2d::Zero();
  for (const Pair& pair : pairs) {
    mean_e += pair.estimate.translation();
    mean_t += pair.truth.translation();
  }
  mean_e /= static_cast<double>(pairs.size());
  mean_t /= static_cast<double>(pairs.size());
  double dot = 0.0, cross = 0.0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector2d e = pair.estimate.translation() - mean_e, t = pair.truth.translation() - mean_t;
    dot += e.dot(t);
    cross += e.x() * t.y() - e.y() * t.x();
  }
  const Pose2 turn{0.0, 0.0, std::atan2(cross, dot)};
  const Eigen::Vector2d shift = mean_t - turn * mean_e;
  return {shift.x(), shift.y(), turn.theta};
}

}  // namespace

Result<TrajectoryError> CompareTrajectories(const Trajectory& estimate, const Trajectory& truth, Alignment alignment) {
  constexpr double kLongestGap_s = 0.5;
  std::vector<Pair> pairs;
  for (const StampedPose& pose : estimate) {
    if (const auto true_pose = PoseOn(truth, pose.stamp, kLongestGap_s))
      pairs.push_back({pose.T_map_robot, *true_pose});
  }
  if (pairs.empty()) {
    return Fail(StatusCode::kNotFound, "no pose of the estimate lies within the time of the truth");
  }
  const Pose2 T_truth_estimate = alignment == Alignment::kSe2 ? BestFit(pairs) : Pose2{};

  TrajectoryError error;
  error.compared = pairs.size();
  error.skipped = estimate.size() - pairs.size();
  Percentiles distances;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Pose2 aligned = T_truth_estimate * pairs[i].estimate;
    const double distance = (aligned.translation() - pairs[i].truth.translation()).norm();
    const double turn = std::abs(AngleDiff(aligned.theta, pairs[i].truth.theta));
    distances.Add(distance);
    error.rmse_m += distance * distance;
    error.mean_m += distance;
    error.max_m = std::max(error.max_m, distance);
    error.rmse_rad += turn * turn;
    error.max_rad = std::max(error.max_rad, turn);
    error.final_m = distance;
    if (i > 0) error.way_m += (pairs[i].truth.translation() - pairs[i - 1].truth.translation()).norm();
  }
  const auto n = static_cast<double>(pairs.size());
  error.rmse_m = std::sqrt(error.rmse_m / n);
  error.mean_m /= n;
  error.median_m = distances.At(0.5);
  error.rmse_rad = std::sqrt(error.rmse_rad / n);
  return error;
}

}  // namespace cairn::client
