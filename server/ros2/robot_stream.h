// One ROS 2 robot at the door: turns what its namespace publishes into the values that the native door passes on, and
// opens and keeps its session for it. It pushes a session request first and samples behind it; the channel keeps the
// order. It needs three things before it opens a session: a scan, odometry, and how the lidar of the scan is mounted.
// A robot whose scans arrive for five seconds without anything that publishes odometry has none: it is followed by its
// scans alone, and its frame is the first of ros2.base_frames that transforms connect with a lidar. What is missing, or
// refused, it says in words (Problems). Where somebody says where the robot is while it has a session, the server is
// asked to look for it there (TakeHint). Not thread-safe: the door holds its lock. Time is given by the caller.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/ros2/frame_tree.h"
#include "common/ros2/scan_conversion.h"
#include "common/service/pose_report.h"
#include "common/service/request.h"
#include "common/service/session.h"
#include "common/wire/ros2/bus.h"
#include "common/wire/ros2/sample_numbers.h"
#include "server/inbound.h"
#include "server/ros2/namespace_rules.h"
#include "server/ros2/ros2_options.h"

namespace cairn::server {

class RobotStream {
 public:
  using Clock = std::chrono::steady_clock;

  // `shared_frames`: the transforms of the topics /tf and /tf_static, which all robots share.
  RobotStream(RobotPlace place, const Ros2Options& options, const ros2::FrameTree& shared_frames, Inbound& inbound);

  // `topic`: the name of the stream in the namespace, such as "scan".
  void Take(const std::string& topic, ros2::LaserScan&& message, const ros2::Origin& origin, Clock::time_point now);
  void Take(ros2::Odometry&& message, const ros2::Origin& origin, Clock::time_point now);
  // Of the namespace's own tf and tf_static.
  void Take(const ros2::Transforms& message, const ros2::Origin& origin, Clock::time_point now);
  // Odometry that comes as a transform on the shared tf. `its_own`: also frames that do not begin with the robot's
  // name.
  void TakeShared(const ros2::Transforms& message, bool its_own, const ros2::Origin& origin, Clock::time_point now);
  // Notes who publishes the transform from map to odom. `fixed`: of tf_static, where it is said once.
  void SeeMapToOdom(const ros2::Transforms& message, bool fixed, const ros2::WriterId& writer, Clock::time_point now);
  // The robot is here now. A session of which a scan was used goes on, if the server can look for the robot there
  // (TakeHint); otherwise the next session begins at this pose.
  void TakeStart(const ros2::PoseWithCovariance& message, Clock::time_point now);

  // What the server is to be asked because of the newest initial pose, once for each. The caller passes the answer to
  // TakeHintAnswer, with the number.
  struct Hint {
    std::uint64_t number = 0;
    Request request;
  };
  [[nodiscard]] std::optional<Hint> TakeHint();
  // FAILED_PRECONDITION and NOT_FOUND: the robot is not joined with the map of its site, or has no session. It begins a
  // new session at the pose then.
  void TakeHintAnswer(std::uint64_t number, const Status& status);

  // Its site was reset, and its session with it: a new one begins, wherever the robot is.
  void BeginAnew();

  // From the server.
  void Take(const SessionState& state, Clock::time_point now);
  void Take(const SessionRefusal& refusal, Clock::time_point now);
  void Take(const PoseReport& report, Clock::time_point now);

  // Which writers exist now. A robot without a publisher of scans is away.
  void SetPublishers(bool scans, bool odometry, Clock::time_point now);
  // The server was told that the robot is away, or has no session of it.
  [[nodiscard]] bool IsAway() const { return phase_ != Phase::kOpen || !alive_; }
  // Opens what has to be opened again.
  void Tick(Clock::time_point now);

  [[nodiscard]] const RobotPlace& place() const { return place_; }
  [[nodiscard]] bool open() const { return phase_ == Phase::kOpen; }
  // The frame that the transform from the map leads to; that of the robot itself where it has no odometry. Empty as
  // long as it is not known.
  [[nodiscard]] const std::string& odom_frame() const { return odom_frame_.empty() ? base_frame_ : odom_frame_; }
  // Its scans are used, and the last pose is localized.
  [[nodiscard]] bool IsOnMap(Clock::time_point now) const;
  // Why it is not on the map, or what else is wrong. `server_clock`: the time of the server, as stamps say it;
  // `others`: the writers of other participants.
  [[nodiscard]] std::vector<std::string> Problems(Clock::time_point now, Stamp server_clock,
                                                  const std::set<ros2::WriterId>& others) const;
  // Values that did not fit into the inbound channel.
  [[nodiscard]] std::uint64_t overflow() const { return overflow_; }

 private:
  enum class Phase { kWaiting, kOpen, kRefused, kEnded };
  struct Lidar {
    std::string sensor;  // Its name in the session.
    ros2::SampleNumbers numbers;
    std::string frame;
    std::string why_not;  // Why its scans cannot be used; empty if they can.
    std::optional<ros2::Mounting> mounting;
    std::uint64_t frames_version = 0;
    std::optional<Stamp> stamp;
    Clock::time_point received{};
    // Its last scan goes round, and says that all beams were measured at once.
    bool round_at_once = false;
  };

  Lidar& LidarOf(const std::string& topic);
  void FindMounting(Lidar& lidar);
  void TakeOdometry(const std::string& parent, const std::string& child, Stamp stamp, const ros2::Pose3& pose,
                    const ros2::Origin& origin, Clock::time_point now);
  void TakeTransformOdometry(const ros2::Transforms& message, bool its_own, const ros2::Origin& origin,
                             Clock::time_point now);
  void OpenIfComplete(Clock::time_point now);
  void Open(Clock::time_point now);
  void Refused(const Status& why, Clock::time_point now);
  // Leaves the present session, so that a new one may begin (robots/roster.h).
  void Leave(const std::optional<Pose2>& start);
  bool Push(InboundValue&& value);
  void Send(const Odometry& odometry, const ros2::Origin& origin);
  [[nodiscard]] bool odometry_is_fresh(Clock::time_point now) const;
  [[nodiscard]] bool BaseHasAParent() const;
  [[nodiscard]] bool HasNoOdometry(Clock::time_point now) const;
  void GuessBaseFrame();
  [[nodiscard]] std::string WhyNoOdometry(Clock::time_point now) const;
  [[nodiscard]] std::vector<std::string> BeamTimesInDoubt(Clock::time_point now) const;
  [[nodiscard]] std::vector<std::string> ProblemsOfScans(Clock::time_point now) const;
  [[nodiscard]] std::string WhyNoSession() const;
  [[nodiscard]] std::string WhyNoPose(Clock::time_point now) const;
  [[nodiscard]] std::string WhyOtherClock(Clock::time_point now, Stamp server_clock) const;
  [[nodiscard]] bool OthersPublishMapToOdom(Clock::time_point now, const std::set<ros2::WriterId>& others) const;
  [[nodiscard]] const std::string& odom_frame_or_usual() const;

  struct EarlyOdometry {
    Odometry odometry;
    ros2::Origin origin;
  };
  struct MapToOdom {
    Clock::time_point seen{};
    bool fixed = false;
  };

  const RobotPlace place_;
  const NameId robot_id_;
  const Ros2Options options_;
  const ros2::FrameTree& shared_frames_;
  Inbound& inbound_;
  ros2::FrameTree frames_;
  std::map<std::string, Lidar> lidars_;  // By topic.

  std::string odom_frame_;
  std::string base_frame_;  // Empty until odometry says it, or it is known that there is none.
  ros2::SampleNumbers odometry_numbers_;
  std::deque<EarlyOdometry> early_;  // The last ones: the first scan of a session needs odometry before it.
  std::optional<Stamp> odometry_stamp_;
  Clock::time_point odometry_received_{};
  std::string odometry_fault_;
  std::optional<Clock::time_point> scans_since_;  // Since then scans arrive, and nothing publishes odometry.

  Phase phase_ = Phase::kWaiting;
  ClientId client_ = 0;
  SessionToken session_ = 0;
  std::optional<Pose2> start_;          // Of the next session.
  Clock::time_point start_received_{};  // The newest initial pose.
  std::optional<Pose2> hint_;           // Until the server has answered.
  bool hint_asked_ = false;             // This one was handed out, ...
  bool hint_open_ = false;              // ... and the last one that was is not answered yet.
  std::uint64_t hint_number_ = 0;
  std::string why_hint_failed_;  // Empty if it did not fail.
  std::string why_refused_;
  std::string refusal_logged_;       // Empty while none was logged since a session was opened.
  SessionToken opening_logged_ = 0;  // The last session of which the log says that it is opened.
  Clock::time_point try_again_{};
  bool scans_published_ = false;
  bool odometry_published_ = false;
  bool alive_ = true;                    // As the server was told last.
  std::optional<PoseReport> last_pose_;  // Of this session.
  Clock::time_point pose_received_{};
  std::map<ros2::WriterId, MapToOdom> map_to_odom_;  // Also of this server. At most kMostMapToOdom.
  std::uint64_t overflow_ = 0;
};

}  // namespace cairn::server
