#include "server/ros2/robot_stream.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "common/geometry/angle.h"
#include "common/service/start_pose.h"
#include "server/ingress/admission.h"

namespace cairn::server {
namespace {

constexpr std::chrono::seconds kStartLasts{10};      // The robot may be elsewhere when it is opened later.
constexpr std::chrono::seconds kFresh{2};            // Odometry that is older does not open a session.
constexpr std::chrono::seconds kNoOdometryAfter{5};  // A robot that has scans for so long, and no odometry, has none.
constexpr std::chrono::seconds kTryAgain{1};         // After a refusal that will pass by itself.
constexpr std::chrono::seconds kTryLater{5};         // After any other.
constexpr std::size_t kMaxEarly = 64;                // Odometry samples kept for the first scan of a session.
constexpr std::size_t kMostMapToOdom = 16;           // Publishers of it that are remembered, the newest ones.
constexpr double kRoundRad = 1.5 * kPi;              // A scan of more than that has to be measured by turning.
constexpr const char* kOdometrySensor = "odometry";  // As on the native wire.

// A random number other than 0, as clients of the native wire draw it.
std::uint64_t DrawId() {
  std::random_device random;
  std::uniform_int_distribution<std::uint64_t> any(1);
  return any(random);
}

std::string SensorName(std::string topic) {
  std::replace(topic.begin(), topic.end(), '/', '.');
  return topic;
}

}  // namespace

RobotStream::RobotStream(RobotPlace place, const Ros2Options& options, const ros2::FrameTree& shared_frames,
                         Inbound& inbound)
    : place_(std::move(place)),
      robot_id_(HashName(place_.robot)),
      options_(options),
      shared_frames_(shared_frames),
      inbound_(inbound) {}

RobotStream::Lidar& RobotStream::LidarOf(const std::string& topic) {
  const auto [lidar, is_new] = lidars_.try_emplace(topic);
  if (is_new) lidar->second.sensor = SensorName(topic);
  return lidar->second;
}

void RobotStream::FindMounting(Lidar& lidar) {
  const std::uint64_t version = frames_.version() + shared_frames_.version() + 1;
  if (lidar.frames_version == version) return;
  lidar.mounting.reset();
  if (lidar.frame.empty()) {
    lidar.why_not = "its scans name no frame (header.frame_id is empty)";
  } else if (base_frame_.empty()) {
    lidar.why_not = "the frame of the robot is not known yet, because there is no odometry";
    return;  // Odometry does not change the version.
  } else if (const auto motion =
                 ros2::FindMotion(std::array<const ros2::FrameTree*, 2>{&frames_, &shared_frames_}, base_frame_,
                                  lidar.frame, std::array{odom_frame_or_usual(), options_.map_frame})) {
    const auto mounting = ros2::MountingOf(*motion);
    lidar.why_not = mounting ? std::string() : mounting.error().message;
    if (mounting) lidar.mounting = *mounting;
  } else {
    lidar.why_not = "no transform connects its frame '" + lidar.frame + "' with the robot's frame '" + base_frame_ +
                    "': neither tf_static nor tf has one (is robot_state_publisher running in this namespace?)";
  }
  lidar.frames_version = version;
}

void RobotStream::Take(const std::string& topic, ros2::LaserScan&& message, const ros2::Origin& origin,
                       Clock::time_point now) {
  Lidar& lidar = LidarOf(topic);
  const bool is_new = !lidar.stamp;
  lidar.stamp = message.header.stamp;
  lidar.received = now;
  lidar.round_at_once = message.time_increment == 0.0 &&
                        std::abs(message.angle_increment) * static_cast<double>(message.ranges.size()) > kRoundRad;
  if (message.header.frame != lidar.frame) {
    lidar.frame = message.header.frame;
    lidar.frames_version = 0;
  }
  if (!scans_since_) scans_since_ = now;
  if (HasNoOdometry(now)) GuessBaseFrame();
  FindMounting(lidar);
  if (phase_ != Phase::kOpen) {
    OpenIfComplete(now);
    if (phase_ != Phase::kOpen) return;
  } else if (is_new) {
    Open(now);  // The same session, with one sensor more.
  }
  const std::uint64_t number = lidar.numbers.Next(origin);
  // A scan of a lidar whose place is not known is counted as refused, with an impossible mounting.
  ros2::Mounting mounting;
  mounting.T_robot_laser.x = std::nan("");
  ScanSample sample{{robot_id_, HashName(lidar.sensor), session_},
                    ros2::ScanOf(std::move(message), lidar.mounting.value_or(mounting))};
  sample.scan.sequence = number;
  Push(Admit(std::move(sample), now));
}

void RobotStream::Take(ros2::Odometry&& message, const ros2::Origin& origin, Clock::time_point now) {
  TakeOdometry(message.header.frame, message.child_frame, message.header.stamp, message.pose, origin, now);
}

void RobotStream::TakeOdometry(const std::string& parent, const std::string& child, Stamp stamp,
                               const ros2::Pose3& pose, const ros2::Origin& origin, Clock::time_point now) {
  const auto motion = ros2::MotionOf(pose);
  odometry_fault_ = motion ? std::string() : "its odometry is refused: " + motion.error().message;
  if (!motion) return;
  // Some drivers leave the frames empty. Then the first of the usual names has to do.
  const std::string base = child.empty() ? options_.base_names().front() : child;
  if (base != base_frame_) {
    base_frame_ = base;
    for (auto& [topic, lidar] : lidars_) lidar.frames_version = 0;
  }
  odom_frame_ = parent.empty() ? options_.odom_frame : parent;
  odometry_stamp_ = stamp;
  odometry_received_ = now;
  Odometry odometry{.sequence = 0, .stamp = stamp, .T_odom_robot = ros2::PlanarPart(*motion)};
  early_.push_back({odometry, origin});
  if (early_.size() > kMaxEarly) early_.pop_front();
  if (phase_ == Phase::kOpen) Send(odometry, origin);
}

void RobotStream::Send(const Odometry& odometry, const ros2::Origin& origin) {
  OdometrySample sample{{robot_id_, HashName(kOdometrySensor), session_}, odometry};
  sample.odometry.sequence = odometry_numbers_.Next(origin);
  Push(Admit(std::move(sample)));
}

void RobotStream::Take(const ros2::Transforms& message, const ros2::Origin& origin, Clock::time_point now) {
  for (const ros2::Transform& transform : message.transforms) static_cast<void>(frames_.Set(transform));
  TakeTransformOdometry(message, true, origin, now);
}

void RobotStream::TakeShared(const ros2::Transforms& message, bool its_own, const ros2::Origin& origin,
                             Clock::time_point now) {
  TakeTransformOdometry(message, its_own, origin, now);
}

void RobotStream::SeeMapToOdom(const ros2::Transforms& message, bool fixed, const ros2::WriterId& writer,
                               Clock::time_point now) {
  const auto leads_to_odom = [this](const ros2::Transform& transform) {
    return transform.header.frame == options_.map_frame && transform.child_frame == odom_frame_or_usual();
  };
  if (std::none_of(message.transforms.begin(), message.transforms.end(), leads_to_odom)) return;
  map_to_odom_[writer] = {now, fixed};
  if (map_to_odom_.size() <= kMostMapToOdom) return;
  const auto older = [](const auto& one, const auto& other) { return one.second.seen < other.second.seen; };
  map_to_odom_.erase(std::min_element(map_to_odom_.begin(), map_to_odom_.end(), older));
}

const std::string& RobotStream::odom_frame_or_usual() const {
  return odom_frame_.empty() ? options_.odom_frame : odom_frame_;
}

// A robot that publishes no odometry may still say it as the transform from odom to base_link. On the shared tf its
// frames begin with its name.
void RobotStream::TakeTransformOdometry(const ros2::Transforms& message, bool its_own, const ros2::Origin& origin,
                                        Clock::time_point now) {
  if (odometry_published_) return;
  const std::string prefix = place_.robot + "/";
  for (const ros2::Transform& transform : message.transforms) {
    const bool prefixed = transform.header.frame == prefix + options_.odom_frame;
    if (!prefixed && (!its_own || transform.header.frame != options_.odom_frame)) continue;
    for (const std::string& base : options_.base_names()) {
      if (transform.child_frame != (prefixed ? prefix + base : base)) continue;
      TakeOdometry(transform.header.frame, transform.child_frame, transform.header.stamp, transform.T_frame_child,
                   origin, now);
    }
  }
}

void RobotStream::TakeStart(const ros2::PoseWithCovariance& message, Clock::time_point now) {
  const auto motion = ros2::MotionOf(message.pose);
  const bool in_map = message.header.frame == options_.map_frame;
  if (!motion || !in_map || !ValidateStart(ros2::PlanarPart(*motion))) {
    spdlog::warn("ROS 2: an initial pose of {} is ignored, because {}", place_.robot,
                 in_map ? "it is no pose" : "its frame is not '" + options_.map_frame + "'");
    return;
  }
  const Pose2 pose = ros2::PlanarPart(*motion);
  start_received_ = now;
  // A session without a used scan has nothing in which the robot could be looked for, and one that is not joined with
  // the map begins anew there, at once.
  const bool apart = last_pose_ && last_pose_->reason == PoseReason::kNotJoined;
  if (apart) {
    spdlog::info("ROS 2: {} begins a new session at its initial pose: it is not joined with the map of its site",
                 place_.robot);
  }
  if (phase_ != Phase::kOpen || !last_pose_ || apart) return Leave(pose);
  hint_ = pose;
  hint_asked_ = false;
  ++hint_number_;
  why_hint_failed_.clear();
}

std::optional<RobotStream::Hint> RobotStream::TakeHint() {
  // One at a time: the places for orders are few, and of several hints the newest counts.
  if (!hint_ || hint_open_ || std::exchange(hint_asked_, true)) return std::nullopt;
  hint_open_ = true;
  Hint hint{hint_number_, {}};
  hint.request.kind = RequestKind::kRelocalise;
  hint.request.robot = place_.robot;
  hint.request.T_map_robot = hint_;
  return hint;
}

void RobotStream::TakeHintAnswer(std::uint64_t number, const Status& status) {
  hint_open_ = false;
  if (!hint_ || number != hint_number_) return;  // A newer one counts.
  const Pose2 pose = *hint_;
  hint_.reset();
  if (status.ok()) return spdlog::info("ROS 2: {} is looked for where its initial pose says", place_.robot);
  if (status.code == StatusCode::kFailedPrecondition || status.code == StatusCode::kNotFound) {
    spdlog::info("ROS 2: {} begins a new session at its initial pose: {}", place_.robot, status.message);
    return Leave(pose);
  }
  spdlog::warn("ROS 2: an initial pose of {} is not used: {}", place_.robot, status.message);
  why_hint_failed_ = status.message;
}

void RobotStream::BeginAnew() {
  Leave(std::nullopt);  // Also one that could not be ended.
}

void RobotStream::Leave(const std::optional<Pose2>& start) {
  if (phase_ == Phase::kOpen) Push(ClientLiveliness{client_, robot_id_, false});
  phase_ = Phase::kWaiting;
  client_ = 0;
  session_ = 0;  // What is still said of it is not about the next one.
  last_pose_.reset();
  start_ = start;
  hint_.reset();
  why_hint_failed_.clear();
}

bool RobotStream::odometry_is_fresh(Clock::time_point now) const {
  return odometry_stamp_ && now - odometry_received_ < kFresh;
}

// Something says where the base is: a transform from another odometry frame than the one that is set. A second one,
// from the map, would give the base two parents.
bool RobotStream::BaseHasAParent() const {
  const std::vector<std::string> names = options_.base_names();
  return std::ranges::any_of(names, [&](const std::string& name) {
    return std::ranges::any_of(std::array{&frames_, &shared_frames_}, [&](const ros2::FrameTree* tree) {
      const ros2::FrameTree::Link* const link = tree->Find(name);
      return link != nullptr && std::ranges::find(names, link->parent) == names.end();
    });
  });
}

bool RobotStream::HasNoOdometry(Clock::time_point now) const {
  return !BaseHasAParent() && !odometry_stamp_ && !odometry_published_ && odometry_fault_.empty() && scans_since_ &&
         now - *scans_since_ >= kNoOdometryAfter;
}

// Of a robot without odometry. Transforms may come later than scans, so it is done until one fits.
void RobotStream::GuessBaseFrame() {
  const auto connects = [this](const std::string& base) {
    return std::any_of(lidars_.begin(), lidars_.end(), [&](const auto& one) {
      const std::array<const ros2::FrameTree*, 2> trees{&frames_, &shared_frames_};
      return !one.second.frame.empty() &&
             ros2::FindMotion(trees, base, one.second.frame, std::array{options_.odom_frame, options_.map_frame});
    });
  };
  if (!base_frame_.empty() && connects(base_frame_)) return;
  const std::vector<std::string> names = options_.base_names();
  const auto known = std::find_if(names.begin(), names.end(), connects);
  const std::string& base = known == names.end() ? names.front() : *known;
  if (base == base_frame_) return;
  base_frame_ = base;
  for (auto& [topic, lidar] : lidars_) lidar.frames_version = 0;
}

void RobotStream::OpenIfComplete(Clock::time_point now) {
  if (phase_ == Phase::kEnded || (phase_ == Phase::kRefused && now < try_again_)) return;
  const bool mounted =
      std::any_of(lidars_.begin(), lidars_.end(), [](const auto& one) { return one.second.mounting.has_value(); });
  if (!mounted || !(odometry_is_fresh(now) || HasNoOdometry(now))) return;
  if (start_ && now - start_received_ > kStartLasts) {
    spdlog::warn("ROS 2: an initial pose of {} is not used, because its session could not be opened within {} s",
                 place_.robot, kStartLasts.count());
    start_.reset();
  }
  if (client_ == 0) client_ = DrawId();
  session_ = DrawId();
  last_pose_.reset();
  for (auto& [topic, lidar] : lidars_) lidar.numbers.Restart();
  odometry_numbers_.Restart();
  Open(now);
  if (phase_ != Phase::kOpen) return;
  for (const EarlyOdometry& one : early_) Send(one.odometry, one.origin);
}

// Opens the session, or adds the sensors that are new.
void RobotStream::Open(Clock::time_point now) {
  SessionRequest request{.robot = place_.robot,
                         .site = place_.site,
                         .sensors = {},
                         .client = client_,
                         .has_start = start_.has_value(),
                         .T_map_robot_start = start_.value_or(Pose2{}),
                         .end = false,
                         .session = session_};
  for (const auto& [topic, lidar] : lidars_) request.sensors.push_back(lidar.sensor);
  if (!Push(std::move(request))) return Refused({StatusCode::kResourceExhausted, "the server is busy"}, now);
  phase_ = Phase::kOpen;
  alive_ = true;
  why_refused_.clear();
}

void RobotStream::Refused(const Status& why, Clock::time_point now) {
  const bool passes = why.code == StatusCode::kResourceExhausted || why.code == StatusCode::kUnavailable;
  phase_ = Phase::kRefused;
  why_refused_ = why.message;
  // It is tried again for ever; the log has each reason once.
  if (refusal_logged_ != why.message) {
    spdlog::warn("ROS 2: the session of {} in {} is refused: {}", place_.robot, place_.site, why.message);
    refusal_logged_ = why.message;
  }
  try_again_ = now + (passes ? kTryAgain : kTryLater);
}

void RobotStream::Take(const SessionState& state, Clock::time_point /*now*/) {
  if (state.session != session_ || session_ == 0) return;
  if (state.phase == SessionPhase::kActive) {
    start_.reset();  // It has begun there; it counts once.
    refusal_logged_.clear();
    if (opening_logged_ != session_)
      spdlog::info("ROS 2: the session of {} in {} is opened", place_.robot, place_.site);
    opening_logged_ = session_;
  }
  if (state.phase != SessionPhase::kEnded || phase_ != Phase::kOpen) return;
  phase_ = Phase::kEnded;
  why_refused_ = state.status.message;
}

void RobotStream::Take(const PoseReport& report, Clock::time_point now) {
  if (report.session != session_ || session_ == 0) return;
  last_pose_ = report;
  pose_received_ = now;
}

void RobotStream::Take(const SessionRefusal& refusal, Clock::time_point now) {
  if (refusal.state.session != session_ || refusal.state.client != client_ || phase_ != Phase::kOpen) return;
  Refused(refusal.state.status, now);
}

void RobotStream::SetPublishers(bool scans, bool odometry, Clock::time_point /*now*/) {
  const bool returns = scans && !scans_published_;
  scans_published_ = scans;
  odometry_published_ = odometry;
  if (odometry || !scans) scans_since_.reset();  // It waits anew.
  // A session that somebody has ended is opened again only for a robot that was started again.
  if (returns && phase_ == Phase::kEnded) phase_ = Phase::kWaiting;
  if (phase_ != Phase::kOpen || alive_ == scans) return;
  if (Push(ClientLiveliness{client_, robot_id_, scans})) alive_ = scans;  // Else at the next call.
}

void RobotStream::Tick(Clock::time_point now) {
  for (auto& [topic, lidar] : lidars_) FindMounting(lidar);
  if (phase_ == Phase::kRefused) OpenIfComplete(now);
}

bool RobotStream::Push(InboundValue&& value) {
  if (inbound_.TryPush(std::move(value))) return true;
  ++overflow_;
  return false;
}

}  // namespace cairn::server
