#include "client/cli/ros2_source.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <iterator>
#include <utility>
#include <vector>

#include "common/wall_clock.h"

namespace cairn::client {
namespace {

constexpr std::chrono::milliseconds kTickPeriod{200};
constexpr std::chrono::seconds kAskAgain{2};
constexpr int kDepth = 64, kTransformDepth = 100;
constexpr double kParticipantLease_s = 20.0;  // What ROS 2 programs expect of each other.
constexpr const char* kScanType = "sensor_msgs/msg/LaserScan";
constexpr const char* kOdometryType = "nav_msgs/msg/Odometry";
constexpr const char* kTf = "/tf";
constexpr const char* kTfStatic = "/tf_static";

// The name of a lidar at the server: "/r1/front/scan" of the namespace "/r1" is front.scan.
std::string SensorOf(const std::string& topic, const std::string& name_space) {
  std::string sensor = topic.substr(std::min(topic.size(), name_space == "/" ? 1 : name_space.size() + 1));
  std::replace(sensor.begin(), sensor.end(), '/', '.');
  return sensor;
}

}  // namespace

Result<std::unique_ptr<Ros2Source>> Ros2Source::Create(wire::Bus& bus, RecordQueue& queue, std::set<NameId> robots) {
  auto queries = QueryClient::Create(bus);
  if (!queries) return tl::unexpected(queries.error());
  return std::unique_ptr<Ros2Source>(new Ros2Source(bus, queue, std::move(robots), *std::move(queries)));
}

Ros2Source::Ros2Source(wire::Bus& bus, RecordQueue& queue, std::set<NameId> robots,
                       std::unique_ptr<QueryClient> queries)
    : native_(bus), queue_(queue), wanted_(std::move(robots)), queries_(std::move(queries)) {
  asking_ = std::jthread([this](const std::stop_token& stop) { Ask(stop); });
}

Ros2Source::~Ros2Source() {
  {
    const MutexLock lock(mutex_);  // Between its look at the request and its waiting there is no gap.
    asking_.request_stop();
    stopping_.NotifyAll();
  }
  asking_ = {};
  receiving_ = {};  // No callback comes any more: the subscriptions may go.
  shared_.clear();
  robots_.clear();
}

std::string Ros2Source::problem() const {
  const MutexLock lock(mutex_);
  return problem_;
}

void Ros2Source::Ask(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    if (auto report = queries_->Ros2(); report && report->door.enabled) {
      if (bus_ == nullptr) Join(report->door.domain);
      const MutexLock lock(mutex_);
      news_ = *std::move(report);
    }
    const auto next = std::chrono::steady_clock::now() + kAskAgain;
    const MutexLock lock(mutex_);
    while (!stop.stop_requested() && stopping_.WaitUntil(mutex_, next)) {
    }
  }
}

void Ros2Source::Join(std::int64_t domain) {
  wire::WireOptions options;
  options.domain = domain;
  options.interfaces = native_.options().interfaces;
  options.participant_lease_s = kParticipantLease_s;
  auto bus = ros2::Bus::Create(options, "cairn_recorder");
  {
    const MutexLock lock(mutex_);
    problem_ = bus ? std::string() : bus.error().message;
  }
  if (!bus) return;
  bus_ = *std::move(bus);
  receiving_ = std::jthread([this](const std::stop_token& stop) {
    // A message that there is no memory for is missing in the recording, where its number shows it.
    bus_->Run(
        stop, [this] { Tick(); }, kTickPeriod, [](const std::exception&) {});
  });
}

void Ros2Source::Tick() {
  std::optional<Ros2Report> report;
  {
    const MutexLock lock(mutex_);
    report = std::exchange(news_, std::nullopt);
  }
  if (!report) return;
  std::set<std::string> named;
  for (const Ros2Namespace& one : report->namespaces) {
    if (one.robot.empty() || (!wanted_.empty() && wanted_.count(HashName(one.robot)) == 0)) continue;
    named.insert(one.name);
    Follow(one);
  }
  for (auto robot = robots_.begin(); robot != robots_.end();)
    robot = named.count(robot->first) > 0 ? std::next(robot) : robots_.erase(robot);
  for (const bool fixed : {false, true})
    Keep<ros2::Transforms>(
        shared_, fixed ? kTfStatic : kTf, {fixed, fixed, kTransformDepth},
        [this, fixed](ros2::Transforms&& message, const ros2::Origin& origin) { TakeShared(message, origin, fixed); });
}

void Ros2Source::Follow(const Ros2Namespace& one) {
  Robot& robot = robots_.try_emplace(one.name, one.robot, shared_frames_).first->second;
  ros2::Qos tf{false, false, kTransformDepth}, tf_static{true, true, kTransformDepth};
  bool has_odometry = false;
  for (const Ros2Topic& topic : one.topics) {
    const ros2::Qos qos{topic.reliable, false, kDepth};
    if (topic.name == one.name + kTfStatic) {
      tf_static = {topic.reliable, topic.reliable && topic.transient_local, kTransformDepth};
    } else if (topic.received == 0) {
      continue;  // The server does not read it, or there is nothing to read.
    } else if (topic.type == kScanType) {
      Keep<ros2::LaserScan>(robot.subscriptions, topic.name, qos,
                            [this, &robot, sensor = SensorOf(topic.name, one.name)](ros2::LaserScan&& message,
                                                                                    const ros2::Origin& origin) {
                              if (auto sample = robot.samples.Take(sensor, std::move(message), origin))
                                Push(*std::move(sample));
                            });
    } else if (topic.type == kOdometryType) {
      has_odometry = true;
      Keep<ros2::Odometry>(robot.subscriptions, topic.name, qos,
                           [this, &robot](ros2::Odometry&& message, const ros2::Origin& origin) {
                             if (auto sample = robot.samples.Take(message, origin)) Push(*std::move(sample));
                           });
    }
  }
  robot.samples.SetOdometryTopic(has_odometry);
  if (one.name == "/") return;  // Its transforms are the shared ones.
  for (const bool fixed : {false, true})
    Keep<ros2::Transforms>(robot.subscriptions, one.name + (fixed ? kTfStatic : kTf), fixed ? tf_static : tf,
                           [this, &robot](ros2::Transforms&& message, const ros2::Origin& origin) {
                             for (OdometrySample& sample : robot.samples.Take(message, origin)) Push(std::move(sample));
                           });
}

// Above the odometry there is only the map, which does not say how a lidar is mounted.
void Ros2Source::TakeShared(const ros2::Transforms& message, const ros2::Origin& origin, bool fixed) {
  for (const ros2::Transform& transform : message.transforms)
    if (transform.header.frame != "map") static_cast<void>(shared_frames_.Set(transform));
  if (fixed) return;
  for (auto& [name, robot] : robots_)
    for (OdometrySample& sample : robot.samples.TakeShared(message, robots_.size() == 1 || name == "/", origin))
      Push(std::move(sample));
}

template <typename Message, typename Take>
void Ros2Source::Keep(Subscriptions& subscriptions, const std::string& topic, const ros2::Qos& qos, Take take) {
  Kept& kept = subscriptions[topic];
  if (kept.subscription != nullptr && kept.qos == qos) return;
  kept.subscription.reset();
  auto made = bus_->Subscribe<Message>("rt" + topic, qos, std::move(take));
  if (!made) {
    const MutexLock lock(mutex_);
    problem_ = topic + ": " + made.error().message;
    return;
  }
  kept = {qos, *std::move(made)};
}

template <typename Sample>
void Ros2Source::Push(Sample&& sample) {
  RecordEvent event;
  event.time = WallClock();
  event.value = std::forward<Sample>(sample);
  queue_.Push(std::move(event));
}

}  // namespace cairn::client
