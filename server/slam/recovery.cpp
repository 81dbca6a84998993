#include "server/slam/recovery.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kMaxRecent = 120;  // Scans that are kept: turning on the spot makes many.
// A place is the expected one within these errors of the search and of the map, and so many standard deviations of the
// motion, but never beyond what is the most.
constexpr double kExpectedM = 0.5;
constexpr double kExpectedRad = 0.2;
constexpr double kSigmas = 3.0;
constexpr double kMostExpectedM = 1.5;
constexpr double kMostExpectedRad = 0.6;
constexpr double kUnknownM = 1000.0;  // Standard deviation of a place that is not known.
constexpr double kNever = -1.0;       // No search yet.

}  // namespace

void Recovery::Begin(const Known& known, bool odometry_goes_on) {
  End();
  active_ = true;
  odometry_goes_on_ = odometry_goes_on;
  known_ = known;
}

void Recovery::End() {
  active_ = false;
  contradicted_ = false;
  ForgetScans();
  search_.Forget();
}

void Recovery::ForgetScans() {
  recent_ = {};
  unconfirmed_.clear();
  searched_at_m_ = kNever;
}

Pose2 Recovery::FromLast(const Pose2& T_track_robot) const {
  return Between(recent_.shapes.back().T_track_robot, T_track_robot);
}

std::optional<FoundPlace> Recovery::Take(std::shared_ptr<const Scan> scan, const Pose2& T_track_robot,
                                         const Pose2& T_odom_robot, std::vector<SurfacePoint> points_robot,
                                         const Trail& trail, const SharedSequence<Pose2>& path) {
  const double travelled_m =
      has_scans() ? recent_.shapes.back().travelled_m + FromLast(T_track_robot).translation().norm() : 0.0;
  recent_.scans.push_back(std::move(scan));
  recent_.shapes.push_back({T_track_robot, travelled_m, std::move(points_robot)});
  while (recent_.scans.size() > kMaxRecent || travelled_m - recent_.shapes.front().travelled_m > loop_.recent_m) {
    recent_.scans.erase(recent_.scans.begin());
    recent_.shapes.erase(recent_.shapes.begin());
  }
  const Belief belief = BeliefAt(T_odom_robot);
  contradicted_ = search_.Compare(trail, path, *recent_.scans.back(), recent_.shapes.back().points,
                                  belief.T_map_robot) == PlaceSearch::Agreement::kContradicts;
  if (searched_at_m_ != kNever && travelled_m - searched_at_m_ < loop_.every_m) return std::nullopt;
  searched_at_m_ = travelled_m;
  const auto found = search_.Find(trail, path, recent_);
  if (found && (IsWhereExpected(found->T_map_robot, belief) || IsConfirmed(found->T_map_robot))) return found;
  return std::nullopt;
}

bool Recovery::IsWhereExpected(const Pose2& T_map_robot, const Belief& belief) const {
  // Nobody knows whether a robot with new odometry has been moved: it is expected nowhere else than where it was.
  const Eigen::Matrix3d doubt = odometry_goes_on_ ? belief.doubt : Eigen::Matrix3d::Zero();
  const Eigen::Vector3d error = Minus(T_map_robot, belief.T_map_robot);
  const double sigma_m = std::sqrt(std::max(doubt(0, 0), doubt(1, 1)));
  return error.head<2>().norm() < std::min(kExpectedM + kSigmas * sigma_m, kMostExpectedM) &&
         std::abs(error.z()) < std::min(kExpectedRad + kSigmas * std::sqrt(doubt(2, 2)), kMostExpectedRad);
}

bool Recovery::IsConfirmed(const Pose2& T_map_robot) {
  const KeyframeShape& now = recent_.shapes.back();
  while (!unconfirmed_.empty() && now.travelled_m - unconfirmed_.front().travelled_m > loop_.confirm_within_m)
    unconfirmed_.pop_front();
  for (const Candidate& earlier : unconfirmed_) {
    if (now.travelled_m - earlier.travelled_m < loop_.confirm_after_m) continue;
    const Pose2 difference = Between(earlier.T_map_track * now.T_track_robot, T_map_robot);
    if (difference.translation().norm() < loop_.agree_m && std::abs(difference.theta) < loop_.agree_rad) return true;
  }
  unconfirmed_.push_back({T_map_robot * now.T_track_robot.Inverse(), now.travelled_m});
  return false;
}

Recovery::Belief Recovery::BeliefAt(const Pose2& T_odom_robot) const {
  if (!odometry_goes_on_) {
    const Eigen::Vector3d unknown(kUnknownM * kUnknownM, kUnknownM * kUnknownM, kPi * kPi);
    return {known_.T_map_robot, unknown.asDiagonal(), unknown.asDiagonal(), PoseReason::kLost};
  }
  const Pose2 moved = Between(known_.T_odom_robot, T_odom_robot);
  const Eigen::Matrix3d J_known = J_compose_left(known_.T_map_robot, moved);
  const Eigen::Matrix3d J_moved = J_compose_right(known_.T_map_robot, moved);
  const Eigen::Matrix3d doubt = J_moved * blind_.Covariance(moved) * J_moved.transpose();
  const bool lost = contradicted_ || moved.translation().norm() > lost_after_m_;
  return {known_.T_map_robot * moved, J_known * known_.covariance * J_known.transpose() + doubt, doubt,
          lost ? PoseReason::kLost : PoseReason::kOdometryOnly};
}

}  // namespace cairn::slam
