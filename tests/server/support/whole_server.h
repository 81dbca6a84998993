// The whole server in one process without DDS: the test stands where the doors would, pushes into the inbound channel
// and keeps everything that comes out. Waits are on conditions with deadlines.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "server/ingress/admission.h"
#include "server/server.h"
#include "tests/eventually.h"
#include "tests/server/support/room_world.h"

namespace cairn::server::testing {

inline ServerOptions TestOptions() {
  ServerOptions options;
  options.slam.filter.particles = 20;
  options.maps.publish_rate_hz = 20;
  options.robots.ledger_rate_hz = 50;
  return options;
}

class WholeServer {
 public:
  static constexpr Generation kGeneration = 7;

  using Watcher = std::function<void(const OutboundValue&)>;

  // `journal`: the server restores what its store holds, and stores its own state there. `saved`: the directory of
  // saved sites. `watcher` is called with every value that is sent, on the thread of the server that sends it. To
  // disturb that thread it may wait or throw, which watchers otherwise must not (Outbound::Watch).
  explicit WholeServer(const ServerOptions& options = TestOptions(), Journal* journal = nullptr,
                       Generation generation = kGeneration, const std::filesystem::path& saved = {},
                       const Watcher& watcher = {})
      : inbound_(static_cast<std::size_t>(options.server.inbound_capacity)),
        outbound_(static_cast<std::size_t>(options.server.outbound_capacity)),
        server_(options, inbound_, outbound_, generation, journal, saved) {
    if (watcher) {
      outbound_.Watch([watcher](const OutboundValue& value) {
        watcher(value);
        return false;
      });
    }
    for (const auto lane : {Outbound::Lane::kLive, Outbound::Lane::kMap, Outbound::Lane::kReplies}) {
      readers_.emplace_back([this, lane] {
        while (auto value = outbound_.lane(lane).Pop()) Keep(std::move(*value));
      });
    }
    EXPECT_TRUE(server_.Start());
  }
  ~WholeServer() { Stop(); }

  void Stop() {
    server_.Stop();
    readers_.clear();
  }

  void Push(InboundValue value) { ASSERT_TRUE(inbound_.Push(std::move(value))); }

  void Open(const std::string& robot, ClientId client, const std::string& site = "lab",
            const std::optional<Pose2>& start = Pose2{}, std::uint64_t map_frame = 0) {
    SessionToken& token = tokens_[{robot, client}];
    if (token == 0 || LastState(robot, client).phase == SessionPhase::kEnded) token += client;
    Push(SessionRequest{.robot = robot,
                        .site = site,
                        .sensors = {"laser"},
                        .client = client,
                        .has_start = start.has_value(),
                        .T_map_robot_start = start.value_or(Pose2{}),
                        .end = false,
                        .session = TokenOf(robot, client),
                        .started = false,
                        .map_frame = map_frame});
  }
  void End(const std::string& robot, ClientId client) {
    Push(SessionRequest{.robot = robot,
                        .site = "lab",
                        .sensors = {"laser"},
                        .client = client,
                        .has_start = false,
                        .T_map_robot_start = {},
                        .end = true,
                        .session = TokenOf(robot, client)});
  }
  // The session that the client opened last for the robot.
  SessionToken TokenOf(const std::string& robot, ClientId client) const {
    const auto known = tokens_.find({robot, client});
    return known == tokens_.end() ? client : known->second;
  }
  void SendScan(const std::string& robot, ClientId client, Scan scan) {
    Push(Admit(ScanSample{{HashName(robot), HashName("laser"), TokenOf(robot, client)}, std::move(scan)},
               std::chrono::steady_clock::now()));
  }
  void SendOdometry(const std::string& robot, ClientId client, const Odometry& odometry) {
    Push(Admit(OdometrySample{{HashName(robot), HashName("odometry"), TokenOf(robot, client)}, odometry}));
  }
  // Steps [first, last) of the room world, in order, never more than 16 scans ahead of the server.
  void Drive(const std::string& robot, ClientId client, int first, int last) {
    for (int step = first; step < last; ++step) {
      SendOdometry(robot, client, RoomOdometry(step));
      SendScan(robot, client, RoomScan(step));
      if (step % 16 == 15) WaitSettled(robot, static_cast<std::uint64_t>(step) + 1);
    }
    WaitSettled(robot, static_cast<std::uint64_t>(last));
  }
  void WaitSettled(const std::string& robot, std::uint64_t sequence) {
    ASSERT_TRUE(WaitFor([&] { return LastLedger(robot).settled_through >= sequence; }))
        << robot << " settled " << LastLedger(robot).settled_through << " of " << sequence;
  }

  // The answer to a request, its parts joined. Status DEADLINE_EXCEEDED where none came.
  Reply Ask(Request request) {
    request.client = 4242;
    request.sequence = ++requests_;
    Push(request);
    Reply whole;
    whole.status.code = StatusCode::kDeadlineExceeded;
    WaitFor([&] {
      for (const Reply& part : All<Reply>()) {
        if (part.sequence != request.sequence || !part.last) continue;
        whole = Join(request.sequence);
        return true;
      }
      return false;
    });
    return whole;
  }

  // Everything of one kind that came out so far, in order.
  template <typename Value>
  std::vector<Value> All() const {
    const MutexLock lock(mutex_);
    std::vector<Value> all;
    for (const OutboundValue& value : kept_) {
      if (const Value* one = std::get_if<Value>(&value)) all.push_back(*one);
    }
    return all;
  }
  Ledger LastLedger(const std::string& robot) const {
    Ledger last;
    for (const Ledger& ledger : All<Ledger>()) {
      if (ledger.robot_id == HashName(robot) && ledger.sensor_id != HashName("odometry")) last = ledger;
    }
    return last;
  }
  // The newest state of a robot's session as one client sees it.
  SessionState LastState(const std::string& robot, ClientId client) const {
    SessionState last;
    const MutexLock lock(mutex_);
    for (const OutboundValue& value : kept_) {
      const auto* const refusal = std::get_if<SessionRefusal>(&value);
      const SessionState* const state = refusal != nullptr ? &refusal->state : std::get_if<SessionState>(&value);
      if (state != nullptr && state->robot == robot && state->client == client) last = *state;
    }
    return last;
  }
  bool WaitPhase(const std::string& robot, ClientId client, SessionPhase phase) const {
    return WaitFor([&] {
      const SessionState state = LastState(robot, client);
      return state.robot == robot && state.phase == phase;
    });
  }
  Job WaitJob(std::uint64_t id) const {
    Job last;
    WaitFor([&] {
      for (const Job& job : All<Job>()) {
        if (job.id == id) last = job;
      }
      return last.id == id && IsFinal(last.state);
    });
    return last;
  }
  // The tiles a late joiner would hold: the newest of each key that is not deleted.
  std::map<TileKey, Tile> CurrentTiles() const {
    std::map<TileKey, Tile> tiles;
    for (const TileSample& sample : All<TileSample>()) {
      if (sample.deleted) {
        tiles.erase(sample.tile.key);
      } else {
        tiles[sample.tile.key] = sample.tile;
      }
    }
    return tiles;
  }

  bool WaitFor(const std::function<bool()>& condition, std::chrono::seconds at_most = test::kDeadline) const {
    const auto deadline = std::chrono::steady_clock::now() + at_most;
    while (!condition()) {
      const MutexLock lock(mutex_);
      if (std::chrono::steady_clock::now() > deadline) return false;
      arrived_.WaitFor(mutex_, std::chrono::milliseconds(20));
    }
    return true;
  }

  Server& server() { return server_; }

 private:
  void Keep(OutboundValue&& value) {
    const MutexLock lock(mutex_);
    kept_.push_back(std::move(value));
    arrived_.NotifyAll();
  }
  Reply Join(std::int64_t sequence) const {
    Reply whole;
    for (Reply& part : All<Reply>()) {
      if (part.sequence != sequence) continue;
      if (part.part == 0) {
        whole = std::move(part);
        continue;
      }
      whole.path.insert(whole.path.end(), part.path.begin(), part.path.end());
      whole.tiles.insert(whole.tiles.end(), part.tiles.begin(), part.tiles.end());
    }
    return whole;
  }

  Inbound inbound_;
  Outbound outbound_;
  Server server_;
  std::int64_t requests_ = 0;
  std::map<std::pair<std::string, ClientId>, SessionToken> tokens_;
  mutable Mutex mutex_;
  mutable CondVar arrived_;
  std::vector<OutboundValue> kept_ CAIRN_GUARDED_BY(mutex_);
  std::vector<std::jthread> readers_;
};

}  // namespace cairn::server::testing
