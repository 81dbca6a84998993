// What the doors hand to the rooms: plain values over one bounded channel. The only way in.
// Values leave in the order they came, but each of three lanes has a bound of its own, so that a flood in one never
// displaces a value of another: control (session requests, liveliness), questions, and streams (scans, odometry). In
// the lane of streams one robot has at most a quarter of the room, and at least kLeastShare, so that a robot that
// floods takes nothing away from the others.
// Overflow rule: a DDS callback never waits. What does not fit is refused, and counted by the door: scans show as a gap
// in their numbers (lost_on_wire in the ledger), questions and session requests are answered "busy" at once.
// Liveliness is never refused, because nobody would repeat it: the newest of a client replaces an older one that still
// waits, so there are at most as many as there are clients.
// Thread rule: any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>
#include <variant>

#include "common/mutex.h"
#include "common/service/ledger.h"
#include "common/service/request.h"
#include "common/service/session.h"
#include "common/service/stream.h"

namespace cairn::server {

// The samples of a stream are numbered from 1. No client counts farther than this.
inline constexpr std::uint64_t kMaxSequence = INT64_MAX;

// A scan at the door. Refused ones carry sequence and stamp only: they are counted, never estimated.
struct ScanArrival {
  StreamId stream;
  std::shared_ptr<const Scan> scan;
  std::optional<DropReason> refused;
  std::chrono::steady_clock::time_point received;
};

struct OdometryArrival {
  StreamId stream;
  Odometry odometry;
  bool refused = false;
};

// A client process gained or lost its liveliness lease, as far as it speaks for this robot.
struct ClientLiveliness {
  ClientId client = 0;
  NameId robot_id = 0;
  bool alive = false;
};

using InboundValue = std::variant<SessionRequest, ClientLiveliness, ScanArrival, OdometryArrival, Request>;

class Inbound {
 public:
  static constexpr std::size_t kMaxControl = 1024;
  static constexpr std::size_t kLeastShare = 64;

  // At most `capacity` values of streams wait, as many questions, and kMaxControl session requests.
  explicit Inbound(std::size_t capacity) : capacity_(capacity) {}

  // False if the value's lane is full or the channel is closed: `value` is then untouched.
  [[nodiscard]] bool TryPush(InboundValue&& value) CAIRN_EXCLUDES(mutex_);
  // Waits for room; false if the channel is or becomes closed.
  [[nodiscard]] bool Push(InboundValue value) CAIRN_EXCLUDES(mutex_);
  // The value that came first; waits for one. Nothing if the channel is closed and empty, or a stop is requested.
  [[nodiscard]] std::optional<InboundValue> Pop(const std::stop_token& stop = {}) CAIRN_EXCLUDES(mutex_);
  // Nothing more comes in, what is inside still goes out.
  void Close() CAIRN_EXCLUDES(mutex_);

  [[nodiscard]] std::size_t size() const CAIRN_EXCLUDES(mutex_);
  // How many values have left the channel so far: shows that its receiver moves.
  [[nodiscard]] std::uint64_t taken() const CAIRN_EXCLUDES(mutex_);

 private:
  struct Arrived {
    std::uint64_t number = 0;
    InboundValue value;
  };
  using Lane = std::deque<Arrived>;

  bool PushLocked(InboundValue& value) CAIRN_REQUIRES(mutex_);
  Lane& LaneOf(const InboundValue& value) CAIRN_REQUIRES(mutex_);
  std::optional<InboundValue> PopLocked() CAIRN_REQUIRES(mutex_);
  void ForgetOlder(const ClientLiveliness& news) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool HasShare(const InboundValue& value) const CAIRN_REQUIRES(mutex_);

  const std::size_t capacity_;
  mutable Mutex mutex_;
  CondVar filled_;
  CondVar room_;
  std::uint64_t next_ CAIRN_GUARDED_BY(mutex_) = 0;
  Lane control_ CAIRN_GUARDED_BY(mutex_);
  Lane questions_ CAIRN_GUARDED_BY(mutex_);
  Lane streams_ CAIRN_GUARDED_BY(mutex_);
  std::map<NameId, std::size_t> in_streams_ CAIRN_GUARDED_BY(mutex_);  // Values that wait there, by robot.
  std::uint64_t taken_ CAIRN_GUARDED_BY(mutex_) = 0;
  bool closed_ CAIRN_GUARDED_BY(mutex_) = false;
};

}  // namespace cairn::server
