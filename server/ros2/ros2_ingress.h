// What the ROS 2 robots publish, on its way in: looks which namespaces have publishers of scans or odometry, subscribes
// to the topics of those that belong to a robot (namespace_rules.h), and hands the messages to the robot's stream. A
// topic is read with the QoS that its publishers offer: reliable where all are, else best effort. What robots ask of
// the server (RobotStream::TakeHint) goes to the desk through the calls that it shares with the services. Thread rule:
// Tick, the messages and the answers of the calls come on the thread of the bus; Take and report may be called from any
// thread.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/service/ros2_report.h"
#include "common/wire/ros2/bus.h"
#include "server/inbound.h"
#include "server/outbound.h"
#include "server/ros2/command_calls.h"
#include "server/ros2/robot_stream.h"
#include "server/ros2/shared_frames.h"

namespace cairn::server {

// Where a robot's poses are published.
struct RobotAddress {
  NameId robot_id = 0;
  std::string name_space;
  std::string tf_topic;    // As on the wire.
  std::string odom_frame;  // Empty until it is known.

  bool operator==(const RobotAddress&) const = default;
};

class Ros2Ingress {
 public:
  using Clock = RobotStream::Clock;
  // Both are called on the thread of the bus. `serve`: a robot appears, or its address changes; `leave`: it is
  // forgotten.
  Ros2Ingress(ros2::Bus& bus, const Ros2Options& options, NamespaceRules rules, Inbound& inbound, CommandCalls& calls,
              std::function<void(const RobotAddress&)> serve, std::function<void(NameId)> leave);
  ~Ros2Ingress();

  void Tick(Clock::time_point now) CAIRN_EXCLUDES(mutex_);
  // What the server sends of sessions and poses: kept for the next Tick. Never waits for the bus.
  void Take(const OutboundValue& value) CAIRN_EXCLUDES(news_mutex_);
  // The robots of a site that was reset open new sessions. On the thread of the bus.
  void BeginAnew(const std::string& site) CAIRN_EXCLUDES(mutex_);
  // Ends all subscriptions. REQUIRES: the bus does not run.
  void Close() CAIRN_EXCLUDES(mutex_);

  [[nodiscard]] std::vector<Ros2Namespace> report(Clock::time_point now) const CAIRN_EXCLUDES(mutex_);
  // What concerns several robots, for people: frames of the shared topics that two publishers contend for, maps that
  // others publish as well.
  [[nodiscard]] std::vector<std::string> problems() const CAIRN_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t overflow() const CAIRN_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t malformed() const CAIRN_EXCLUDES(mutex_);

 private:
  // A topic of a namespace, with what its publishers offer.
  struct Topic {
    std::string type;
    std::uint32_t publishers = 0;
    bool all_reliable = true;
    bool all_transient_local = true;
    // Of the subscription, if there is one.
    std::unique_ptr<ros2::Subscription> subscription;
    ros2::Qos qos;
    std::uint64_t received = 0;
    std::uint64_t received_before = 0;
    double rate_hz = 0.0;
  };
  struct Namespace {
    std::optional<RobotPlace> place;
    std::unique_ptr<RobotStream> robot;
    std::map<std::string, Topic> topics;  // By the name of the stream.
    RobotAddress address;
  };

  // What a robot asks of the server, by the name of its namespace.
  using Hints = std::vector<std::pair<std::string, RobotStream::Hint>>;

  [[nodiscard]] Hints TickRobots(Clock::time_point now) CAIRN_EXCLUDES(mutex_);
  void TakeHintAnswer(const std::string& name, std::uint64_t number, const Status& status) CAIRN_EXCLUDES(mutex_);
  void Discover(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  void CountPublishers() CAIRN_REQUIRES(mutex_);
  // Makes room: forgets the namespaces in which nobody publishes any more. The server keeps their sessions as long as
  // those of any robot that is away, and a robot that returns goes on. Returns whether there was one.
  bool ForgetGone(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  void Note(const ros2::RemoteWriter& writer) CAIRN_REQUIRES(mutex_);
  // Makes, renews and ends the subscriptions of a namespace.
  void Subscribe(const std::string& name, Namespace& one) CAIRN_REQUIRES(mutex_);
  template <typename Message>
  void Keep(const std::string& wire_name, Topic& topic, int depth, bool transient_local,
            std::function<void(Message&&, const ros2::Origin&)> take) CAIRN_REQUIRES(mutex_);
  void SubscribeShared() CAIRN_REQUIRES(mutex_);
  void TakeShared(ros2::Transforms&& message, const ros2::Origin& origin, bool fixed) CAIRN_REQUIRES(mutex_);
  void TellRobots(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  void End(Topic& topic) CAIRN_REQUIRES(mutex_);
  void Measure(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] RobotAddress AddressOf(const std::string& name, const Namespace& one) const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] std::vector<std::string> ProblemsOf(const std::string& name, const Namespace& one,
                                                    Clock::time_point now) const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool IsScan(const std::string& stream) const;
  [[nodiscard]] bool HasGone() const CAIRN_REQUIRES(mutex_);
  // Nobody publishes in it.
  [[nodiscard]] static bool IsGone(const Namespace& one);

  ros2::Bus& bus_;
  const Ros2Options options_;
  const std::vector<std::string> scan_names_;
  const NamespaceRules rules_;
  Inbound& inbound_;
  CommandCalls& calls_;
  const std::function<void(const RobotAddress&)> serve_;
  const std::function<void(NameId)> leave_;

  mutable Mutex mutex_;
  SharedFrames shared_frames_ CAIRN_GUARDED_BY(mutex_);
  std::map<std::string, Topic> shared_ CAIRN_GUARDED_BY(mutex_);  // tf and tf_static.
  std::map<std::string, Namespace> namespaces_ CAIRN_GUARDED_BY(mutex_);
  std::uint64_t writers_version_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::set<ros2::WriterId> writers_ CAIRN_GUARDED_BY(mutex_);    // Of others, as of the last look.
  std::set<std::string> foreign_maps_ CAIRN_GUARDED_BY(mutex_);  // Topics of grids that others publish, as on the wire.
  Clock::time_point measured_ CAIRN_GUARDED_BY(mutex_){};
  std::uint64_t ended_refused_ CAIRN_GUARDED_BY(mutex_) = 0;        // Of subscriptions that have ended.
  std::uint64_t ended_overflow_ CAIRN_GUARDED_BY(mutex_) = 0;       // Of robots that were forgotten.
  std::uint64_t publishers_left_out_ CAIRN_GUARDED_BY(mutex_) = 0;  // Their namespaces found no room.

  // The newest of each robot, until the next Tick.
  struct News {
    std::optional<SessionState> state;
    std::optional<SessionRefusal> refusal;
    std::optional<PoseReport> pose;
  };
  Mutex news_mutex_;
  std::map<NameId, News> news_ CAIRN_GUARDED_BY(news_mutex_);
};

}  // namespace cairn::server
