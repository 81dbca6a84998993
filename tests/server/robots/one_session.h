// One session on a thread pool of its own. Everything it sends is kept; `on_send` may look at a value first, refuse it,
// throw, or hold the sender up. Waits are on conditions with deadlines.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "server/robots/session.h"
#include "tests/eventually.h"
#include "tests/server/support/room_world.h"

namespace cairn::server::testing {

inline constexpr ClientId kOwner = 7;

// What the owner's laser sends, if the robot is called r1.
inline const StreamId kScans{HashName("r1"), HashName("laser"), kOwner};

// A client has one session, whose token is the client's id.
inline SessionRequest RequestOf(const std::string& robot, ClientId client = kOwner) {
  return {.robot = robot,
          .site = "lab",
          .sensors = {"laser"},
          .client = client,
          .has_start = false,
          .T_map_robot_start = {},
          .end = false,
          .session = client};
}

inline ScanArrival ScanOf(const std::string& robot, Scan scan, ClientId client = kOwner) {
  return {.stream = {HashName(robot), HashName("laser"), client},
          .scan = std::make_shared<const Scan>(std::move(scan)),
          .refused = std::nullopt,
          .received = std::chrono::steady_clock::now()};
}

inline OdometryArrival OdometryOf(const std::string& robot, const Odometry& odometry, ClientId client = kOwner) {
  return {.stream = {HashName(robot), HashName("odometry"), client}, .odometry = odometry, .refused = false};
}

inline std::uint64_t Dropped(const Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

// What was sent, in order, and the means to wait for more.
class Sent {
 public:
  bool Keep(OutboundValue&& value) {
    const MutexLock lock(mutex_);
    values_.push_back(std::move(value));
    came_.NotifyAll();
    return true;
  }
  void ForEach(const std::function<void(const OutboundValue&)>& see) const {
    const MutexLock lock(mutex_);
    for (const OutboundValue& value : values_) see(value);
  }
  template <typename Value>
  std::vector<Value> All() const {
    const MutexLock lock(mutex_);
    std::vector<Value> all;
    for (const OutboundValue& value : values_) {
      if (const Value* const one = std::get_if<Value>(&value)) all.push_back(*one);
    }
    return all;
  }
  bool WaitFor(const std::function<bool()>& condition) const {
    const auto deadline = std::chrono::steady_clock::now() + test::kDeadline;
    while (!condition()) {
      const MutexLock lock(mutex_);
      if (std::chrono::steady_clock::now() > deadline) return false;
      came_.WaitFor(mutex_, std::chrono::milliseconds(5));
    }
    return true;
  }

 private:
  mutable Mutex mutex_;
  mutable CondVar came_;
  std::vector<OutboundValue> values_ CAIRN_GUARDED_BY(mutex_);
};

class OneSession {
 public:
  explicit OneSession(const RobotsOptions& options = {}, const std::string& robot = "r1",
                      const slam::PairingOptions& pairing = {})
      : robot_(robot) {
    EstimatorSetup estimator;
    estimator.mapper.pairing = pairing;
    estimator.mapper.filter.particles = 20;
    session_ = std::make_shared<Session>(
        SessionSetup{.id = 1, .request = RequestOf(robot), .map_epoch = 3, .estimator = estimator}, options, pool_,
        SessionOutputs{.send =
                           [this](OutboundValue value) {
                             const bool taken = !on_send || on_send(value);
                             return taken && sent_.Keep(std::move(value));
                           },
                       .grid_changed = [this](GridChange&&) { ++grid_changes; },
                       .store =
                           [this](JournalEntry entry) {
                             if (on_store) on_store(std::move(entry));
                             return true;
                           },
                       .position = [this] { return position.load(); },
                       .checkpoint =
                           [this](std::uint64_t, const Journal::Content&, const Journal::Done& done) {
                             if (done) stored_.set_value(done);
                             ++checkpoints;
                             return true;
                           },
                       .recover = [this] { return on_recover ? on_recover() : 0; },
                       .abandon = [this] { position = 0; },
                       .checkpoint_limits = {.entries = 1, .work = {}}});
    EXPECT_TRUE(session_->record().AddSensors({"laser"}));
  }
  ~OneSession() { pool_.join(); }

  // Steps [first, last) of the room world.
  void Drive(int first, int last) {
    for (int step = first; step < last; ++step) {
      session_->Take(OdometryOf(robot_, RoomOdometry(step)));
      EXPECT_TRUE(session_->Take(ScanOf(robot_, RoomScan(step))));
    }
  }
  // Occupies the session's strand until the promise is kept.
  [[nodiscard]] std::shared_ptr<std::promise<void>> HoldStrand() {
    auto release = std::make_shared<std::promise<void>>();
    EXPECT_TRUE(
        session_->Post(SnapshotWanted{[release, held = std::make_shared<std::future<void>>(release->get_future())](
                                          SessionMaterial&&) { held->wait(); }}));
    return release;
  }
  [[nodiscard]] Ledger ledger() const { return session_->record().snapshot().status.ledgers.at(0); }
  [[nodiscard]] SessionPhase phase() const { return session_->record().phase(); }
  [[nodiscard]] bool WaitPhase(SessionPhase wanted) const {
    return sent_.WaitFor([&] { return phase() == wanted; });
  }
  [[nodiscard]] bool WaitSettled(std::uint64_t sequence) const {
    return sent_.WaitFor([&] { return ledger().settled_through >= sequence; });
  }

  // Waits, as a server does that looks after it now and then, for the next checkpoint after which the session counts as
  // stored again; returns what its journal calls then.
  [[nodiscard]] Journal::Done WaitStoring() {
    auto stored = stored_.get_future();
    const bool asked = sent_.WaitFor([&] {
      session_->Tick();
      return stored.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    });
    if (!asked) throw std::runtime_error("no checkpoint was asked for");
    stored_ = {};
    return stored.get();
  }

  Session& session() { return *session_; }
  const Sent& sent() const { return sent_; }
  std::function<bool(const OutboundValue&)> on_send;  // Set before anything arrives.
  std::function<void(JournalEntry&&)> on_store;       // The same. On the strand.
  std::atomic<int> grid_changes{0};
  // A checkpoint is due when the position is above that of the last one.
  std::atomic<std::uint64_t> position{0};
  std::atomic<int> checkpoints{0};
  std::function<std::uint64_t()> on_recover;  // Set before the session is lost. On the strand.

 private:
  const std::string robot_;
  std::promise<Journal::Done> stored_;
  asio::thread_pool pool_{2};
  Sent sent_;
  std::shared_ptr<Session> session_;
};

}  // namespace cairn::server::testing
