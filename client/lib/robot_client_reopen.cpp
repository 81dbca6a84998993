// The part of RobotClient that opens a new session where the server does not know the one before, and decides where it
// begins.
#include <algorithm>
#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/robot_client.h"
#include "common/sensor/odometry_continuity.h"

namespace cairn::client {
namespace {

// How long a new session waits for odometry after its first scan, which tells exactly where the robot was.
constexpr std::chrono::milliseconds kOdometryPatience{500};
// While no scan was used for longer, somebody may have carried the robot.
constexpr std::uint64_t kLongestPauseNs = 2 * kNanosPerSecond;

}  // namespace

// A new session begins with its first scan: only then it is known where the robot is at its start.
bool RobotClient::ReadyToReopen() const {
  if (!backlog_.FirstScan()) return false;
  const auto odometry = backlog_.OdometryAtFirstScan();
  return (odometry && odometry->complete) || Clock::now() - refused_ > kOdometryPatience;
}

void RobotClient::WatchOdometry(const Odometry& odometry) {
  constexpr std::size_t kMaxBeginnings = 64;
  const std::size_t known = newest_odometry_.size();
  if (known > 0 && !GoesOn({.earlier = known >= 2 ? &newest_odometry_.front() : nullptr,
                            .before = newest_odometry_.back(),
                            .after = odometry,
                            .logged = odometry.T_odom_robot})) {
    began_anew_.push_back(odometry.stamp);
    newest_odometry_.clear();
  }
  newest_odometry_.push_back(odometry);
  if (newest_odometry_.size() > 2) newest_odometry_.pop_front();
  if (began_anew_.size() > kMaxBeginnings) began_anew_.pop_front();
}

bool RobotClient::IsOneDrive(Stamp a, Stamp b) const {
  return std::ranges::none_of(began_anew_,
                              [a, b](Stamp stamp) { return stamp > std::min(a, b) && stamp <= std::max(a, b); });
}

// The last reported pose (or, if there is none, the start of the session), moved on by the odometry since then. Nothing
// if the robot was not localized or may be elsewhere, because the server would believe the pose.
std::optional<Pose2> RobotClient::StartOfNextSession() const {
  if (pose_ ? !pose_->localized : start_unknown_) return std::nullopt;
  const auto odometry = backlog_.OdometryAtFirstScan();
  if (pose_) {
    const Stamp scan = backlog_.FirstScan().value_or(pose_->stamp);
    if (NanosBetween(std::min(scan, pose_->stamp), std::max(scan, pose_->stamp)) > kLongestPauseNs) return std::nullopt;
    if (!odometry) return pose_->T_map_robot;
    if (!IsOneDrive(std::min(scan, pose_->stamp), std::max(odometry->newest, pose_->stamp))) return std::nullopt;
    return pose_->T_map_odom * odometry->T_odom_robot;
  }
  // Scans have been used, and no pose has come: nothing says where the robot was when they were taken.
  if (scans_used_) return std::nullopt;
  if (!request_.has_start) return std::nullopt;  // Nobody has said where it was at the beginning either.
  const Pose2 first = request_.T_map_robot_start;
  if (!odometry || !start_odometry_) return first;
  if (!IsOneDrive(start_odometry_->stamp, odometry->newest)) return std::nullopt;
  return first * Between(start_odometry_->T_odom_robot, odometry->T_odom_robot);
}

void RobotClient::Reopen() {
  SessionToken session = 0;
  std::optional<Pose2> start;
  {
    const MutexLock sending(sending_);
    const MutexLock lock(mutex_);
    start = StartOfNextSession();
    session = NewClientId();
    request_.session = session;
    start_unknown_ = !start;
    request_.has_start = start.has_value();
    request_.T_map_robot_start = start.value_or(Pose2{});
    // Another map of this name may be there now, with another origin. Without a pose, the start is that of the last
    // session carried on, in the map of that start.
    request_.map_frame = !start ? 0 : pose_ && state_ ? state_->map_frame : request_.map_frame;
    request_.started = false;
    // If this session is lost before its first pose, the next one starts from here.
    if (const auto odometry = backlog_.OdometryAtFirstScan())
      start_odometry_ = Odometry{.stamp = odometry->newest, .T_odom_robot = odometry->T_odom_robot};
    pose_.reset();
    scans_used_ = false;
    sent_before_ = backlog_.size() - backlog_.unsent();
    const std::map<NameId, std::uint64_t> highest = backlog_.MoveTo(session);
    for (auto& [sensor_id, stream] : streams_) {
      stream.sent = stream.arrived = 0;
      const auto sent = highest.find(sensor_id);
      stream.window.Restart(sent == highest.end() ? 0 : sent->second);
    }
    answered_ = false;
    reopening_ = false;
    restarted_.fetch_add(1, std::memory_order_relaxed);
  }
  if (callbacks_.restarted) callbacks_.restarted(session, start.value_or(Pose2{}));
  Ask();
}

}  // namespace cairn::client
