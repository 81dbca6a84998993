// The DDS domain as typed publications and subscriptions of Cairn's plain values: participants, topics, QoS
// and the conversion from and to IDL types live behind this header, and nothing else of the project includes
// a DDS header. Received samples are only converted. A sample whose lengths or enums are out of range is
// dropped and counted by refused(); the contents are validated by the receiver.
// Thread rule: a Bus and what it makes may be used from any thread; Publish may be called concurrently.
// Subscription callbacks and events run on a thread of the subscription's own, one at a time and in order;
// while one runs, its topic waits, so they only convert, push and return.
// Source of the choices: the measured notes on Fast DDS 2.9 in idl/README.md.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/service/refusals.h"
#include "common/service/request.h"
#include "common/service/stream.h"
#include "common/status.h"
#include "common/wire/limits.h"

namespace cairn::wire {

struct WireOptions {
  std::int64_t domain = 0;
  std::vector<std::string> interfaces = {"127.0.0.1"};  // Addresses to bind. They must be named one by one.
  double liveliness_lease_s = 1.0;
  double participant_lease_s = 3.0;
  // Directory with the identity and the permissions of this program (deploy/security). Empty: no DDS Security.
  std::string security;
  // "ADDRESS" or "ADDRESS:PORT" of discovery servers of Fast DDS, in the order of their numbers (fast-discovery-server
  // -i). Empty: participants find each other by multicast.
  std::vector<std::string> discovery_servers;
  // Not an option of the file: after how many samples a keyed writer of the server is replaced. Tests use less.
  std::uint64_t most_written = kMostWritten;
};
// Checks domain, addresses (IPv4, each once), discovery servers and leases, independently of the machine.
[[nodiscard]] Result<void> Validate(const WireOptions& options);
// Checks that this machine has the addresses now. REQUIRES: Validate(options). kUnavailable: an address is
// missing; it may appear later.
[[nodiscard]] Result<void> RequireInterfaces(const WireOptions& options);
void Visit(OptionVisitor& visitor, WireOptions& options);  // `interfaces` as one comma-separated text.

template <typename Value>
class Publication {
 public:
  using ValueType = Value;
  virtual ~Publication() = default;
  // kOutOfRange: the value exceeds the wire's limits (limits.h). kUnavailable: the middleware did not accept
  // it within its bounded blocking time.
  [[nodiscard]] virtual Result<void> Publish(const Value& value) = 0;
  // Marks the key of `value` as no longer needed. When the topic's instances are used up, its place is given to another
  // key, and late joiners no longer get its last sample. A later Publish of the same key takes a new place. Only for
  // SessionState, PoseReport, Ledger, Job, MapInfo and TileSample. kNotFound: nothing of that key was published.
  [[nodiscard]] virtual Result<void> Retire(const Value& value) = 0;
  // Waits until every matched subscription has acknowledged everything, or the deadline passes (false).
  [[nodiscard]] virtual bool WaitForAcknowledgement(std::chrono::milliseconds deadline) = 0;
  // Peers of the same topic, type name and QoS. Their data representation is not compared.
  [[nodiscard]] virtual int matched() const = 0;
};

struct SubscriptionEvents {
  std::function<void(int lost_total)> lost;  // Samples lost on the wire.
  // For SessionRequest only: the lease of the writer whose last request named `client` has run out, or the
  // writer has left (false); or a sample of the writer arrives again (true).
  std::function<void(ClientId client, NameId robot_id, bool alive)> liveliness;
  std::function<void(const std::string& policy)> incompatible_qos;  // A peer that will never match.
  std::function<void(int matched)> matched;                         // The number of publications changed.
};

class Subscription {
 public:
  virtual ~Subscription() = default;  // Returns after the last callback; not to be called from one.
  [[nodiscard]] virtual int matched() const = 0;
  [[nodiscard]] virtual std::uint64_t refused() const = 0;  // Samples not decoded or over the limits.
};

// Value is one of: SessionRequest, SessionState, SessionRefusal, ScanSample, OdometrySample, PoseReport, Ledger,
// MapInfo, TileSample, Job, Request, Command, Reply. Publications and subscriptions may outlive the Bus that made them.
class Bus {
 public:
  virtual ~Bus() = default;
  [[nodiscard]] static Result<std::unique_ptr<Bus>> Create(const WireOptions& options, const std::string& name);

  // `robot`: whose stream it is (SessionRequest, ScanSample, OdometrySample). With security, the subscribers drop
  // what is about another robot. kPermissionDenied: this program's permissions do not allow it.
  template <typename Value>
  [[nodiscard]] Result<std::unique_ptr<Publication<Value>>> Advertise(const std::string& robot = {});
  template <typename Value>
  [[nodiscard]] Result<std::unique_ptr<Subscription>> Subscribe(std::function<void(Value&&)> on_value,
                                                                SubscriptionEvents events = {});
  // Like Subscribe<Reply>, but of the replies to other clients only some are sent here (partitions.h), and
  // those are skipped undecoded.
  [[nodiscard]] Result<std::unique_ptr<Subscription>> SubscribeReplies(ClientId client,
                                                                       std::function<void(Reply&&)> on_value,
                                                                       SubscriptionEvents events = {});
  // Like Subscribe<Value>, but only what is about this robot, and of the others only a share is sent here
  // (partitions.h). Value is PoseReport or Ledger.
  template <typename Value>
  [[nodiscard]] Result<std::unique_ptr<Subscription>> SubscribeRobot(NameId robot_id,
                                                                     std::function<void(Value&&)> on_value,
                                                                     SubscriptionEvents events = {});

  [[nodiscard]] virtual const WireOptions& options() const = 0;
  // Number of datagrams that were not valid or not plausible RTPS and were therefore not passed to the middleware.
  [[nodiscard]] virtual std::uint64_t datagrams_refused() const = 0;
  // All that has arrived, also what was refused.
  [[nodiscard]] virtual std::uint64_t bytes_received() const = 0;
  // For how long the middleware has been busy with one datagram, which takes microseconds. Nothing arrives meanwhile.
  [[nodiscard]] virtual std::chrono::nanoseconds busy_with_one_datagram() const = 0;
  // The refused ones by reason, for people: "12 framing, 3 sequence"; "none" where there are none.
  [[nodiscard]] virtual std::string refused_by_reason() const = 0;
  // What was refused because of its sender. `commands` is not counted here.
  [[nodiscard]] virtual Refusals refusals() const = 0;
  // For the program's log: who was refused since the last call, and why. Each peer once, and a bounded number.
  [[nodiscard]] virtual std::vector<std::string> TakeRefusalLines() = 0;

 protected:
  Bus() = default;
};

}  // namespace cairn::wire
