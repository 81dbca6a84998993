// The DDS domain of the ROS 2 robots: a participant of its own behind the same guard as the native one
// (common/wire/bus.h), with the names, the QoS and the user data that rmw_fastrtps and rmw_cyclonedds use. Nothing else
// includes a DDS header. Received samples are decoded, checked for their lengths (convert.h) and handed on; what fails
// is counted.
//
// Thread rule: everything that arrives is handed on by one thread, that of Run, which also calls `tick`. Subscriptions
// are made and destroyed on this thread, or while it does not run. Publications may be used from any thread.
//
// Sources: rmw_fastrtps and rmw_cyclonedds (names, QoS, user data), rmw_dds_common (typehash).
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "common/ros2/messages.h"
#include "common/status.h"
#include "common/wire/bus.h"

namespace cairn::ros2 {

using wire::WireOptions;

// The QoS that ROS 2 programs choose; the rest of their QoS is the default of DDS.
struct Qos {
  bool reliable = false;
  bool transient_local = false;
  int depth = 5;

  bool operator==(const Qos&) const = default;
};

// Which writer has sent a sample, and its number there: 1, 2, 3, ... A number that is left out was lost.
using WriterId = std::array<std::uint8_t, 16>;
struct Origin {
  WriterId writer{};
  std::int64_t sequence = 0;
};

// A writer of another participant, as discovery tells it.
struct RemoteWriter {
  WriterId id{};
  std::string topic;  // As on the wire, e.g. "rt/r1/scan".
  std::string type;   // As on the wire, e.g. "sensor_msgs::msg::dds_::LaserScan_".
  bool reliable = false;
  bool transient_local = false;
  std::string type_hash;  // "RIHS01_..." from Iron on; empty before.
};

class Subscription {
 public:
  virtual ~Subscription() = default;
  [[nodiscard]] virtual std::uint64_t refused() const = 0;  // Samples that were not decoded, or over the limits.
};

template <typename Message>
class Publication {
 public:
  virtual ~Publication() = default;
  // kUnavailable: the middleware did not accept it within its bounded blocking time.
  [[nodiscard]] virtual Result<void> Publish(const Message& message) = 0;
  [[nodiscard]] virtual int matched() const = 0;
};

// Who has asked, and what the answer has to be marked with. rmw_fastrtps marks a request with the identity of its
// sample in the inline QoS, rmw_cyclonedds with 16 bytes in front of the message (service_endpoint.h).
struct Caller {
  WriterId writer{};          // The endpoint that asked. Its first 12 bytes are its participant's.
  WriterId answer_to{};       // The endpoint that reads the answer, where the request names it; else that which asked.
  std::int64_t sequence = 0;  // Of the request, as the caller counts.
  bool in_message = false;    // As rmw_cyclonedds does it.
  std::uint64_t client = 0;   // The caller's number for itself, in that case.
};

// Answers a service. Thread-safe.
template <typename S>
class Answers {
 public:
  virtual ~Answers() = default;
  // Whether the reader of the caller's answers is known already. What is sent before that, does not arrive.
  [[nodiscard]] virtual bool Reaches(const Caller& caller) const = 0;
  // kUnavailable: the middleware did not accept it.
  [[nodiscard]] virtual Result<void> Send(const Caller& caller, const typename S::Response& response) = 0;
};

class Bus {
 public:
  virtual ~Bus() = default;
  [[nodiscard]] static Result<std::unique_ptr<Bus>> Create(const WireOptions& options, const std::string& name);

  // The type of message on the wire, as in RemoteWriter.
  template <typename Message>
  [[nodiscard]] static std::string TypeName();
  // Message is LaserScan, Odometry, Transforms or PoseWithCovariance. `topic` as on the wire.
  template <typename Message>
  [[nodiscard]] Result<std::unique_ptr<Subscription>> Subscribe(
      const std::string& topic, const Qos& qos, std::function<void(Message&&, const Origin&)> on_message);
  // Message is any of messages.h.
  template <typename Message>
  [[nodiscard]] Result<std::unique_ptr<Publication<Message>>> Advertise(const std::string& topic, const Qos& qos);

  // `service` is its name as ROS shows it, "/lab/dynamic_map", and S one of services.h (common/ros2). What is asked and
  // what is answered have endpoints of their own, so that answers may be given from any thread.
  template <typename S>
  [[nodiscard]] Result<std::unique_ptr<Subscription>> SubscribeRequests(
      const std::string& service, std::function<void(typename S::Request&&, const Caller&)> on_request);
  template <typename S>
  [[nodiscard]] Result<std::unique_ptr<Answers<S>>> AdvertiseAnswers(const std::string& service);

  // Hands on what arrives until a stop is requested, and calls `tick` at least once a `period`. What throws an
  // exception (a message, a tick) is dropped, `failed` is told, and the loop goes on. `failed` must not throw.
  virtual void Run(const std::stop_token& stop, const std::function<void()>& tick, std::chrono::milliseconds period,
                   const std::function<void(const std::exception&)>& failed) = 0;

  // The writers of others, at most kMaxWriters; the number changes whenever they do.
  static constexpr std::size_t kMaxWriters = 4096;
  [[nodiscard]] virtual std::vector<RemoteWriter> writers() const = 0;
  [[nodiscard]] virtual std::uint64_t writers_version() const = 0;
  [[nodiscard]] virtual std::uint64_t datagrams_refused() const = 0;
  // As of common/wire/bus.h.
  [[nodiscard]] virtual std::chrono::nanoseconds busy_with_one_datagram() const = 0;

 protected:
  Bus() = default;
};

}  // namespace cairn::ros2
