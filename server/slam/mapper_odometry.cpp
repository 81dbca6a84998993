// The part of the mapper that decides whether odometry tells how the robot moves.
#include <algorithm>
#include <cmath>

#include "server/slam/mapper_state.h"

namespace cairn::slam {
namespace {

// Odometry counts as standing where so many keyframes in a row, the last ones, have the same. Between them the scans
// have shown at least seven times slam.gate.distance_m or turn_rad. Real odometry freezes for shorter turns, too.
constexpr std::ptrdiff_t kStandingKeyframes = 8;
// Less than this is no motion: a few counts of cheap encoders.
constexpr double kStandsM = 0.001, kStandsRad = 0.002;
// But they must lead away: a robot that stands among people may seem to move to and fro.
constexpr double kLeadAwayM = 1.0, kLeadAwayRad = 1.0;

}  // namespace

// From what the state has of the keyframes, so that an estimator that was loaded decides as the one that was saved.
bool Mapper::State::OdometryStands(const Pose2& T_odom_robot) const {
  const std::vector<Keyframe>& keyframes = trail.keyframes();
  if (static_cast<std::ptrdiff_t>(keyframes.size()) < kStandingKeyframes) return false;
  const auto same = [&T_odom_robot](const Keyframe& keyframe) {
    const Pose2 moved = Between(keyframe.T_odom_robot, T_odom_robot);
    return keyframe.localized && moved.translation().norm() < kStandsM && std::abs(moved.theta) < kStandsRad;
  };
  if (!std::all_of(keyframes.end() - kStandingKeyframes, keyframes.end(), same)) return false;
  const auto shapes = trail.shapes().last(kStandingKeyframes);
  double turn_rad = 0.0;
  for (std::size_t i = 1; i < shapes.size(); ++i)
    turn_rad += AngleDiff(shapes[i].T_track_robot.theta, shapes[i - 1].T_track_robot.theta);
  const double way_m = (shapes.back().T_track_robot.translation() - shapes.front().T_track_robot.translation()).norm();
  return way_m >= kLeadAwayM || std::abs(turn_rad) >= kLeadAwayRad;
}

MotionSource Mapper::State::UseOfOdometry() const {
  if (!has_odometry || !configured.front_end.use_odometry) return MotionSource::kNone;
  return last_scan && OdometryStands(last_scan->T_odom_robot) ? MotionSource::kStands : MotionSource::kUsed;
}

void Mapper::State::UseOdometry(bool use) {
  use = use && configured.front_end.use_odometry;
  if (options.front_end.use_odometry == use) return;
  options = use ? configured : ForScansAlone(configured);
  front_end.UseOdometry(use, MakeMatcher(options.matcher, options.matching));
  blind.UseOdometry(use);
  recovery.UseOdometry(use);
  revisits = RevisitSearch(options.revisit, options.front_end.refine);
  if (localisation) localisation->UseOdometry(use);
}

// Decides for the next scan. Returns what lies before it: kOdometryBegan if scans alone still show its motion, and
// odometry that of the next one.
Passage Mapper::State::ChooseOdometry(Passage passage, const Scan& scan, const Pose2& T_odom_robot) {
  if (!configured.front_end.use_odometry) return passage == Passage::kOdometryBegan ? Passage::kDriven : passage;
  if (!has_odometry || OdometryStands(T_odom_robot)) {
    UseOdometry(false);
    return passage;
  }
  // Odometry that stood may catch up at once. This jump says nothing: scans have shown the way.
  const bool stood = last_scan && OdometryStands(last_scan->T_odom_robot);
  const bool watched =
      passage == Passage::kDriven ||
      (passage == Passage::kUnknown && last_scan &&
       1e-9 * static_cast<double>(NanosBetween(last_scan->scan->stamp, scan.stamp)) <= options.pairing.max_pause_s);
  if (stood && watched) passage = Passage::kOdometryBegan;
  // Nothing was followed that odometry could go on with.
  if (passage == Passage::kOdometryBegan && !last_scan) passage = Passage::kDriven;
  // What is known of a robot that is looked for, or followed in a map, contains its odometry.
  if (passage == Passage::kOdometryBegan && (localisation || recovery.active() || IsTilted(scan, options.max_tilt_rad)))
    passage = Passage::kUnknown;
  UseOdometry(passage != Passage::kOdometryBegan);
  if (passage == Passage::kOdometryBegan) level.T_odom_robot = last_scan->T_odom_robot = T_odom_robot;
  return passage;
}

void Mapper::ExpectOdometry(bool has_odometry) {
  State& s = *state_;
  s.has_odometry = has_odometry;
  s.UseOdometry(s.UseOfOdometry() == MotionSource::kUsed);
}

MotionSource Mapper::motion_source() const {
  return state_->UseOfOdometry();
}

}  // namespace cairn::slam
