#include "server/ros2/ros2_ingress.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <set>
#include <utility>

namespace cairn::server {
namespace {

constexpr const char* kTf = "tf";
constexpr const char* kTfStatic = "tf_static";
constexpr const char* kInitialPose = "initialpose";
constexpr std::size_t kMaxTopics = 64;  // Of a namespace; beyond, they are not looked at.
// Samples that may wait for the thread of the bus.
constexpr int kScanDepth = 64;
constexpr int kOdometryDepth = 256;
constexpr int kTransformDepth = 256;  // tf_static: one from each publisher.

// "/r1/scan" of "rt/r1/front/scan" is "/r1/front"; the namespace of a topic that no rule names.
std::string DirectoryOf(const std::string& topic) {
  const std::string shown = topic.substr(2);
  const std::size_t slash = shown.rfind('/');
  return slash == 0 ? "/" : shown.substr(0, slash);
}

}  // namespace

Ros2Ingress::Ros2Ingress(ros2::Bus& bus, const Ros2Options& options, NamespaceRules rules, Inbound& inbound,
                         CommandCalls& calls, std::function<void(const RobotAddress&)> serve,
                         std::function<void(NameId)> leave)
    : bus_(bus),
      options_(options),
      scan_names_(options.scan_names()),
      rules_(std::move(rules)),
      inbound_(inbound),
      calls_(calls),
      serve_(std::move(serve)),
      leave_(std::move(leave)) {}

Ros2Ingress::~Ros2Ingress() {
  Close();
}

void Ros2Ingress::Close() {
  const MutexLock lock(mutex_);
  for (auto& [stream, topic] : shared_) End(topic);
  for (auto& [name, one] : namespaces_) {
    for (auto& [stream, topic] : one.topics) End(topic);
  }
}

void Ros2Ingress::End(Topic& topic) {
  if (topic.subscription != nullptr) ended_refused_ += topic.subscription->refused();
  topic.subscription.reset();
}

bool Ros2Ingress::IsGone(const Namespace& one) {
  return std::all_of(one.topics.begin(), one.topics.end(),
                     [](const auto& topic) { return topic.second.publishers == 0; });
}

bool Ros2Ingress::HasGone() const {
  return std::any_of(namespaces_.begin(), namespaces_.end(), [](const auto& one) { return IsGone(one.second); });
}

bool Ros2Ingress::IsScan(const std::string& stream) const {
  return std::find(scan_names_.begin(), scan_names_.end(), stream) != scan_names_.end();
}

// Without the lock, because an answer may come within the call.
void Ros2Ingress::Tick(Clock::time_point now) {
  for (auto& [name, hint] : TickRobots(now)) {
    const std::uint64_t asker = HashName(hint.request.robot);
    const auto answered = [this, robot = name, number = hint.number](const Reply& reply) {
      TakeHintAnswer(robot, number, reply.status);
    };
    try {
      calls_.Ask(asker, std::move(hint.request), answered, now);
    } catch (const std::exception&) {  // The others are asked all the same.
      TakeHintAnswer(name, hint.number, {StatusCode::kResourceExhausted, "the server has no memory left"});
    }
  }
}

Ros2Ingress::Hints Ros2Ingress::TickRobots(Clock::time_point now) {
  const MutexLock lock(mutex_);
  Hints hints;
  // Where there was no room, again: the server may not have heard yet that a robot is away.
  const std::uint64_t version = bus_.writers_version();
  if (version != writers_version_ || (publishers_left_out_ > 0 && HasGone())) {
    writers_version_ = version;
    Discover(now);
  }
  TellRobots(now);
  for (auto& [name, one] : namespaces_) {
    if (one.robot == nullptr) continue;
    const auto has = [&topics = one.topics](const std::string& stream) {
      const auto topic = topics.find(stream);
      return topic != topics.end() && topic->second.subscription != nullptr;
    };
    const bool scans = std::any_of(scan_names_.begin(), scan_names_.end(), has);
    one.robot->SetPublishers(scans, has(options_.odom_topic), now);
    one.robot->Tick(now);
    const RobotAddress address = AddressOf(name, one);
    if (address != one.address) serve_(one.address = address);
    if (auto hint = one.robot->TakeHint()) hints.emplace_back(name, *std::move(hint));
  }
  Measure(now);
  return hints;
}

// The robot may have been forgotten meanwhile.
void Ros2Ingress::TakeHintAnswer(const std::string& name, std::uint64_t number, const Status& status) {
  const MutexLock lock(mutex_);
  const auto found = namespaces_.find(name);
  if (found != namespaces_.end() && found->second.robot != nullptr) found->second.robot->TakeHintAnswer(number, status);
}

void Ros2Ingress::Discover(Clock::time_point now) {
  CountPublishers();
  if (publishers_left_out_ > 0 && ForgetGone(now)) CountPublishers();
  SubscribeShared();
  for (auto& [name, one] : namespaces_) Subscribe(name, one);
  const auto is_empty = [](const auto& one) { return one.second.robot == nullptr && IsGone(one.second); };
  std::erase_if(namespaces_, is_empty);
}

bool Ros2Ingress::ForgetGone(Clock::time_point now) {
  bool forgotten = false;
  std::set<NameId> left;
  for (auto entry = namespaces_.begin(); entry != namespaces_.end();) {
    Namespace& one = entry->second;
    if (IsGone(one) && one.robot != nullptr) one.robot->SetPublishers(false, false, now);
    if (!IsGone(one) || (one.robot != nullptr && !one.robot->IsAway())) {
      ++entry;
      continue;
    }
    for (auto& [stream, topic] : one.topics) End(topic);
    if (one.robot != nullptr) {
      ended_overflow_ += one.robot->overflow();
      left.insert(HashName(one.place->robot));
    }
    entry = namespaces_.erase(entry);
    forgotten = true;
  }
  for (const NameId robot_id : left) leave_(robot_id);
  // Another namespace may be of the same robot. Its topics are made again.
  for (auto& [name, one] : namespaces_)
    if (left.contains(one.address.robot_id)) one.address = {};
  return forgotten;
}

void Ros2Ingress::CountPublishers() {
  publishers_left_out_ = 0;
  for (auto& [stream, topic] : shared_) topic.publishers = 0;
  for (auto& [name, one] : namespaces_) {
    for (auto& [stream, topic] : one.topics) topic.publishers = 0;
  }
  writers_.clear();
  foreign_maps_.clear();
  const std::vector<ros2::RemoteWriter> writers = bus_.writers();
  // Scans and odometry first: they make the namespaces that the other topics belong to.
  const auto makes = [this](const ros2::RemoteWriter& writer) {
    const std::string scan = ros2::Bus::TypeName<ros2::LaserScan>();
    return writer.type == scan || writer.type == ros2::Bus::TypeName<ros2::Odometry>() ||
           std::any_of(scan_names_.begin(), scan_names_.end(), [&writer](const std::string& name) {
             const auto name_space = NamespaceOf(writer.topic, name);
             return name_space.has_value();
           });
  };
  for (const ros2::RemoteWriter& writer : writers) {
    writers_.insert(writer.id);
    if (writer.type == ros2::Bus::TypeName<ros2::Grid>()) foreign_maps_.insert(writer.topic);
  }
  for (const bool first : {true, false}) {
    for (const ros2::RemoteWriter& writer : writers) {
      if (makes(writer) == first && writer.topic.starts_with("rt/")) Note(writer);
    }
  }
  shared_frames_.SetWriters(writers_);
}

void Ros2Ingress::Note(const ros2::RemoteWriter& writer) {
  const auto add = [&writer](Topic& topic) {
    const bool first = topic.publishers++ == 0;
    if (first) topic.type = writer.type;
    topic.all_reliable = writer.reliable && (first || topic.all_reliable);
    topic.all_transient_local = writer.transient_local && (first || topic.all_transient_local);
  };
  std::string stream;
  std::optional<std::string> name;
  std::vector<std::string> known = scan_names_;
  known.insert(known.end(), {options_.odom_topic, kTf, kTfStatic, kInitialPose});
  for (const std::string& candidate : known) {
    name = NamespaceOf(writer.topic, candidate);
    if (!name) continue;
    stream = candidate;
    break;
  }
  if (name == "/" && (stream == kTf || stream == kTfStatic)) return add(shared_[stream]);
  const bool is_scan = writer.type == ros2::Bus::TypeName<ros2::LaserScan>();
  const bool is_odometry = writer.type == ros2::Bus::TypeName<ros2::Odometry>();
  if (!name) {
    // A scan or odometry under another name: shown, so that somebody finds out why it is not used.
    if (!is_scan && !is_odometry) return;
    name = DirectoryOf(writer.topic);
    stream = writer.topic.substr(writer.topic.rfind('/') + 1);
  }
  auto found = namespaces_.find(*name);
  if (found == namespaces_.end()) {
    if (!is_scan && !is_odometry && !IsScan(stream)) return;  // Somebody else's tf.
    if (namespaces_.size() >= static_cast<std::size_t>(options_.max_robots)) {
      ++publishers_left_out_;
      return;
    }
    found = namespaces_.emplace(*name, Namespace{}).first;
    found->second.place = rules_.PlaceOf(*name);
    if (!found->second.place) {
      spdlog::warn("ROS 2: namespace {} publishes {}, but no rule of ros2.namespaces fits it", *name, stream);
    }
  }
  Namespace& one = found->second;
  if (one.topics.size() < kMaxTopics || one.topics.contains(stream)) add(one.topics[stream]);
}

template <typename Message>
void Ros2Ingress::Keep(const std::string& wire_name, Topic& topic, int depth, bool transient_local,
                       std::function<void(Message&&, const ros2::Origin&)> take) {
  if (topic.publishers == 0 || topic.type != ros2::Bus::TypeName<Message>()) {
    return End(topic);
  }
  const ros2::Qos wanted{topic.all_reliable, transient_local && topic.all_transient_local, depth};
  if (topic.subscription != nullptr && topic.qos == wanted) return;
  End(topic);
  auto subscription = bus_.Subscribe<Message>(wire_name, wanted, std::move(take));
  if (!subscription) {
    spdlog::warn("ROS 2: {} cannot be read: {}", wire_name, subscription.error().message);
    return;
  }
  topic.subscription = *std::move(subscription);
  topic.qos = wanted;
}

void Ros2Ingress::Subscribe(const std::string& name, Namespace& one) {
  if (!one.place) return;
  if (one.robot == nullptr) {
    one.robot = std::make_unique<RobotStream>(*one.place, options_, shared_frames_.tree(), inbound_);
  }
  RobotStream* const robot = one.robot.get();
  for (auto& [stream, topic] : one.topics) {
    const std::string wire_name = TopicIn(name, stream);
    // The callbacks end before their namespace is forgotten (End).
    const auto counted = [this, &received = topic.received, robot](auto take) {
      return [this, &received, robot, take](auto&& message, const ros2::Origin& origin) {
        const MutexLock lock(mutex_);
        ++received;
        take(*robot, std::forward<decltype(message)>(message), origin);
      };
    };
    if (IsScan(stream)) {
      Keep<ros2::LaserScan>(wire_name, topic, kScanDepth, false,
                            counted([from = stream](RobotStream& to, auto&& message, const ros2::Origin& origin) {
                              to.Take(from, std::forward<decltype(message)>(message), origin, Clock::now());
                            }));
    } else if (stream == options_.odom_topic) {
      Keep<ros2::Odometry>(wire_name, topic, kOdometryDepth, false,
                           counted([](RobotStream& to, auto&& message, const ros2::Origin& origin) {
                             to.Take(std::forward<decltype(message)>(message), origin, Clock::now());
                           }));
    } else if (stream == kTf || stream == kTfStatic) {
      Keep<ros2::Transforms>(
          wire_name, topic, kTransformDepth, stream == kTfStatic,
          counted([fixed = stream == kTfStatic](RobotStream& to, auto&& message, const ros2::Origin& origin) {
            to.SeeMapToOdom(message, fixed, origin.writer, Clock::now());
            to.Take(message, origin, Clock::now());
          }));
    } else if (stream == kInitialPose) {
      Keep<ros2::PoseWithCovariance>(
          wire_name, topic, 1, false,
          counted([](RobotStream& to, auto&& message, const ros2::Origin&) { to.TakeStart(message, Clock::now()); }));
    }
  }
}

void Ros2Ingress::SubscribeShared() {
  for (auto& [stream, topic] : shared_) {
    const bool fixed = stream == kTfStatic;
    Keep<ros2::Transforms>(
        TopicIn("/", stream), topic, kTransformDepth, fixed,
        [this, fixed, &received = topic.received](ros2::Transforms&& message, const ros2::Origin& origin) {
          const MutexLock lock(mutex_);
          ++received;
          TakeShared(std::move(message), origin, fixed);
        });
  }
}

void Ros2Ingress::TakeShared(ros2::Transforms&& message, const ros2::Origin& origin, bool fixed) {
  const std::string shared_tf = TopicIn("/", kTf);
  for (auto& [name, one] : namespaces_) {
    if (one.robot != nullptr && one.address.tf_topic == shared_tf)
      one.robot->SeeMapToOdom(message, fixed, origin.writer, Clock::now());
  }
  // Below the map are only odometry frames, also those that this server publishes there: not how a lidar is mounted.
  std::erase_if(message.transforms,
                [this](const ros2::Transform& transform) { return transform.header.frame == options_.map_frame; });
  const ros2::Transforms clear = shared_frames_.Take(message, origin.writer, fixed);
  if (fixed) return;
  const auto robots = std::count_if(namespaces_.begin(), namespaces_.end(),
                                    [](const auto& one) { return one.second.robot != nullptr; });
  for (auto& [name, one] : namespaces_) {
    if (one.robot != nullptr) one.robot->TakeShared(clear, robots == 1 || name == "/", origin, Clock::now());
  }
}

RobotAddress Ros2Ingress::AddressOf(const std::string& name, const Namespace& one) const {
  const auto published = [](const std::map<std::string, Topic>& topics) {
    return std::any_of(topics.begin(), topics.end(), [](const auto& topic) {
      return (topic.first == kTf || topic.first == kTfStatic) && topic.second.publishers > 0;
    });
  };
  const bool shared = !published(one.topics) && published(shared_);
  return {HashName(one.place->robot), name, TopicIn(shared ? "/" : name, kTf), one.robot->odom_frame()};
}

void Ros2Ingress::Take(const OutboundValue& value) {
  const MutexLock lock(news_mutex_);
  if (const auto* const state = std::get_if<SessionState>(&value)) {
    news_[state->robot_id].state = *state;
  } else if (const auto* const refusal = std::get_if<SessionRefusal>(&value)) {
    news_[refusal->state.robot_id].refusal = *refusal;
  } else if (const auto* const pose = std::get_if<PoseReport>(&value)) {
    news_[pose->robot_id].pose = *pose;
  }
}

void Ros2Ingress::TellRobots(Clock::time_point now) {
  std::map<NameId, News> news;
  {
    const MutexLock lock(news_mutex_);
    news.swap(news_);
  }
  for (auto& [name, one] : namespaces_) {
    const auto of_robot = one.robot != nullptr ? news.find(HashName(one.place->robot)) : news.end();
    if (of_robot == news.end()) continue;
    if (of_robot->second.state) one.robot->Take(*of_robot->second.state, now);
    if (of_robot->second.refusal) one.robot->Take(*of_robot->second.refusal, now);
    if (of_robot->second.pose) one.robot->Take(*of_robot->second.pose, now);
  }
}

void Ros2Ingress::BeginAnew(const std::string& site) {
  const MutexLock lock(mutex_);
  for (auto& [name, one] : namespaces_) {
    if (one.robot != nullptr && one.place->site == site) one.robot->BeginAnew();
  }
}

}  // namespace cairn::server
