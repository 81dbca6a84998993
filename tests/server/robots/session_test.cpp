#include "server/robots/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using testing::Dropped;
using testing::kOwner;
using testing::OdometryOf;
using testing::OneSession;
using testing::RoomOdometry;
using testing::RoomScan;
using testing::ScanOf;

// Keeps what a session sends. The first ledger's sender is held up as long as nobody else sends one.
class SlowFirstLedger {
 public:
  bool Keep(const OutboundValue& value) {
    const Ledger* const ledger = std::get_if<Ledger>(&value);
    if (ledger == nullptr) return true;
    MutexLock lock(mutex_);
    const bool first = ++senders_ == 1;
    came_.NotifyAll();
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(300);
    while (first && senders_ == 1 && came_.WaitUntil(mutex_, deadline)) {
    }
    received_.push_back(ledger->received);
    came_.NotifyAll();
    return true;
  }
  void AwaitFirstSender() {
    MutexLock lock(mutex_);
    while (senders_ == 0) came_.Wait(mutex_);
  }
  std::vector<std::uint64_t> received() const {
    const MutexLock lock(mutex_);
    return received_;
  }

 private:
  mutable Mutex mutex_;
  CondVar came_;
  int senders_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::vector<std::uint64_t> received_ CAIRN_GUARDED_BY(mutex_);
};

// A ledger taken by the housekeeping and one taken by the door were sent in the wrong order once in some thousand runs:
// the older account stayed the newest that anybody saw, and a client that waited for its scans waited for ever.
TEST(Session, AnOlderLedgerNeverOvertakesANewerOne) {
  RobotsOptions options;
  options.ledger_rate_hz = 1000.0;
  asio::thread_pool pool(1);
  SlowFirstLedger sent;
  const SessionRequest request{.robot = "r1",
                               .site = "lab",
                               .sensors = {"laser"},
                               .client = 7,
                               .has_start = false,
                               .T_map_robot_start = {},
                               .end = false,
                               .session = 7};
  const auto session = std::make_shared<Session>(
      SessionSetup{.id = 1, .request = request, .map_epoch = 1, .estimator = {}}, options, pool,
      SessionOutputs{.send = [&sent](const OutboundValue& value) { return sent.Keep(value); },
                     .grid_changed = [](GridChange&&) {}});
  ASSERT_TRUE(session->record().AddSensors({"laser"}));
  const auto refused = [](std::uint64_t sequence) {
    auto scan = std::make_shared<Scan>();
    scan->sequence = sequence;
    return ScanArrival{.stream = {HashName("r1"), HashName("laser"), 7},
                       .scan = std::move(scan),
                       .refused = DropReason::kEmpty,
                       .received = std::chrono::steady_clock::now()};
  };
  std::jthread housekeeping([&] { session->Tick(); });
  sent.AwaitFirstSender();
  // More scans settle while the first ledger is on its way; a burst is published at once.
  for (std::uint64_t sequence = 1; sequence <= SessionRecord::kSettledBurst; ++sequence)
    EXPECT_TRUE(session->Take(refused(sequence)));
  housekeeping.join();
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (sent.received().back() < SessionRecord::kSettledBurst && std::chrono::steady_clock::now() < deadline)
    session->Tick();
  pool.join();
  const std::vector<std::uint64_t> received = sent.received();
  ASSERT_GE(received.size(), 2U);
  EXPECT_TRUE(std::is_sorted(received.begin(), received.end()));
  EXPECT_EQ(received.back(), SessionRecord::kSettledBurst);
}

TEST(Session, AnswersEveryScanWithAPoseAndSettlesIt) {
  OneSession one;
  one.Drive(0, 20);
  ASSERT_TRUE(one.WaitSettled(20));
  ASSERT_TRUE(one.sent().WaitFor([&] { return one.sent().All<PoseReport>().size() == 20; }));
  const Ledger ledger = one.ledger();
  EXPECT_EQ(ledger.used, 20U);
  EXPECT_EQ(ledger.odometry_received, 20U);
  const PoseReport last = one.sent().All<PoseReport>().back();
  EXPECT_EQ(last.scan_sequence, 20U);
  EXPECT_EQ(last.map_epoch, 3U);
  EXPECT_EQ(last.robot, "r1");
}

TEST(Session, AStrangersStreamIsCountedAndNotUsed) {
  OneSession one;
  one.session().Take(OdometryOf("r1", RoomOdometry(0), 8));
  EXPECT_TRUE(one.session().Take(ScanOf("r1", RoomScan(0), 8)));
  one.Drive(0, 2);
  ASSERT_TRUE(one.WaitSettled(2));
  const Ledger ledger = one.ledger();
  EXPECT_EQ(Dropped(ledger, DropReason::kNotOwner), 1U);
  EXPECT_EQ(ledger.used, 2U);
  EXPECT_EQ(ledger.odometry_received, 2U);
}

TEST(Session, AFullQueueDropsTheOldestScansAndCountsThem) {
  RobotsOptions options;
  options.queue_scans = 4;
  options.queue_odometry = 16;
  OneSession one(options);
  const auto release = one.HoldStrand();
  one.Drive(0, 20);
  release->set_value();
  ASSERT_TRUE(one.WaitSettled(20));
  const Ledger ledger = one.ledger();
  EXPECT_EQ(Dropped(ledger, DropReason::kQueueFull), 16U);
  EXPECT_EQ(ledger.used, 4U);
  EXPECT_EQ(ledger.odometry_merged, 4U);
}

TEST(Session, LivelinessSuspendsAndWakesIt) {
  OneSession one;
  one.session().SetLiveliness(false);
  EXPECT_EQ(one.phase(), SessionPhase::kSuspended);
  one.session().SetLiveliness(false);
  one.session().SetLiveliness(true);
  const auto states = one.sent().All<SessionState>();
  ASSERT_EQ(states.size(), 2U);  // Saying the same twice is no news.
  EXPECT_EQ(states[0].phase, SessionPhase::kSuspended);
  EXPECT_EQ(states[0].status.code, StatusCode::kUnavailable);
  EXPECT_EQ(states[1].phase, SessionPhase::kActive);
  EXPECT_TRUE(states[1].status.ok());
}

TEST(Session, AStateThatCouldNotBeSentIsSentAtTheNextTick) {
  OneSession one;
  bool full = true;
  one.on_send = [&full](const OutboundValue& value) { return !full || !std::holds_alternative<SessionState>(value); };
  one.session().SetLiveliness(false);
  EXPECT_TRUE(one.sent().All<SessionState>().empty());
  full = false;
  one.session().Tick();
  one.session().Tick();
  ASSERT_EQ(one.sent().All<SessionState>().size(), 1U);
  EXPECT_EQ(one.sent().All<SessionState>().front().phase, SessionPhase::kSuspended);
}

TEST(Session, TheEndFinishesWhatArrivedBeforeIt) {
  OneSession one;
  one.Drive(0, 10);
  one.session().End();
  ASSERT_TRUE(one.WaitPhase(SessionPhase::kEnded));
  EXPECT_EQ(one.ledger().used, 10U);
  EXPECT_TRUE(one.session().Take(ScanOf("r1", RoomScan(10))));
  EXPECT_EQ(Dropped(one.ledger(), DropReason::kSessionEnded), 1U);
  one.session().Take(OdometryOf("r1", RoomOdometry(10)));
  EXPECT_EQ(one.ledger().odometry_dropped, 1U);
}

// Sixty-four jobs that asked for a snapshot filled the control lane once; the end was then lost, but answered with OK.
TEST(Session, ABurstOfSnapshotsDoesNotDisplaceTheEnd) {
  OneSession one;
  const auto release = one.HoldStrand();
  std::atomic<int> answered{0};
  int accepted = 0;
  while (one.session().Post(SnapshotWanted{[&answered](SessionMaterial&&) { ++answered; }})) ++accepted;
  one.session().End();
  EXPECT_TRUE(one.session().ending());
  release->set_value();
  ASSERT_TRUE(one.WaitPhase(SessionPhase::kEnded));
  EXPECT_EQ(answered, accepted);
}

// A lease that was lost while the last scans were being finished turned the ended session into a suspended one: its
// robot was told "still ending; try again" for ever.
TEST(Session, NothingWakesASessionThatHasEnded) {
  OneSession one;
  one.session().End();
  ASSERT_TRUE(one.WaitPhase(SessionPhase::kEnded));
  one.session().SetLiveliness(false);
  one.session().SetLiveliness(true);
  EXPECT_EQ(one.phase(), SessionPhase::kEnded);
  EXPECT_FALSE(one.session().Resume(9, 9));
  EXPECT_EQ(one.session().record().owner(), kOwner);
  EXPECT_FALSE(one.session().record().SetPhase(SessionPhase::kSuspended, {}));
  EXPECT_EQ(one.phase(), SessionPhase::kEnded);
}

TEST(Session, WhoeverAsksForTheEndAgainIsAnsweredAgain) {
  OneSession one;
  const auto told = [&one] { return one.sent().All<SessionState>().size(); };
  one.session().End();
  ASSERT_TRUE(one.sent().WaitFor([&] { return told() == 1; }));
  one.session().End();
  EXPECT_EQ(told(), 2U);
}

TEST(Session, WhoeverAsksForTheEndAgainIsToldOnlyAfterIt) {
  OneSession one;
  const auto release = one.HoldStrand();
  std::atomic<int> told{0};
  for (int i = 0; i < 2; ++i)
    one.session().End({}, std::make_shared<Receipt>([&told](bool taken) { told += taken ? 1 : 100; }));
  EXPECT_EQ(told, 0);
  release->set_value();
  EXPECT_TRUE(one.sent().WaitFor([&] { return told == 2; }));
}

TEST(Session, SuspendFinishesTheScansAndCallsBack) {
  OneSession one;
  one.Drive(0, 5);
  std::promise<void> done;
  one.session().Suspend([&done] { done.set_value(); });
  ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
  EXPECT_EQ(one.ledger().used, 5U);
  EXPECT_EQ(one.phase(), SessionPhase::kSuspended);
}

TEST(Session, SuspendAfterTheEndCallsBackToo) {
  OneSession one;
  const auto release = one.HoldStrand();
  one.session().End();
  std::promise<void> done;
  one.session().Suspend([&done] { done.set_value(); });
  release->set_value();
  ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
  EXPECT_EQ(one.phase(), SessionPhase::kEnded);
}

// Anything that threw on a robot's strand, a lack of memory for one, took the process and every other robot with it.
TEST(Session, AnExceptionEndsItWithAReasonAndNothingElse) {
  OneSession broken, healthy({}, "r2");
  broken.on_send = [](const OutboundValue& value) {
    const PoseReport* const pose = std::get_if<PoseReport>(&value);
    if (pose != nullptr && pose->scan_sequence == 5) throw std::runtime_error("no memory for pose 5");
    return true;
  };
  const auto release = broken.HoldStrand();
  broken.Drive(0, 10);
  std::promise<SessionMaterial> material;
  EXPECT_TRUE(broken.session().Post(SnapshotWanted{[&](SessionMaterial&& m) { material.set_value(std::move(m)); }}));
  std::promise<void> dropped;
  std::shared_ptr<void> ticket(nullptr, [&dropped](void*) { dropped.set_value(); });
  broken.session().Adopt({.epoch = 4, .grid = {}, .done = [ticket = std::move(ticket)](Adopted&&) { FAIL(); }});
  release->set_value();
  ASSERT_TRUE(broken.sent().WaitFor([&] { return !broken.sent().All<SessionState>().empty(); }));
  const SessionState state = broken.sent().All<SessionState>().back();
  EXPECT_EQ(state.phase, SessionPhase::kEnded);
  EXPECT_EQ(state.status.code, StatusCode::kInternal);
  EXPECT_THAT(state.status.message, ::testing::HasSubstr("no memory for pose 5"));
  EXPECT_THAT(state.status.message, ::testing::HasSubstr("r1"));
  // No scan stays in the account for ever, whoever asked for a snapshot has his answer, and the server can stop.
  ASSERT_TRUE(broken.WaitSettled(10));
  EXPECT_EQ(broken.ledger().used, 4U);
  EXPECT_EQ(Dropped(broken.ledger(), DropReason::kSessionEnded), 6U);
  EXPECT_EQ(broken.ledger().waiting, 0U);
  EXPECT_TRUE(material.get_future().get().snapshot.keyframes.empty());
  EXPECT_EQ(dropped.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
  std::promise<void> suspended;
  broken.session().Suspend([&suspended] { suspended.set_value(); });
  EXPECT_EQ(suspended.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
  EXPECT_EQ(broken.phase(), SessionPhase::kEnded);
  EXPECT_TRUE(broken.session().Take(ScanOf("r1", RoomScan(10))));
  EXPECT_EQ(Dropped(broken.ledger(), DropReason::kSessionEnded), 7U);

  healthy.Drive(0, 10);
  EXPECT_TRUE(healthy.WaitSettled(10));
  EXPECT_EQ(healthy.ledger().used, 10U);
}

// This room was compiled with a logger of its own, which server.log_level did not reach.
TEST(Session, LogsToTheLoggerOfTheProcess) {
  const auto kept = std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(8);
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", kept));
  {
    OneSession one;
    one.on_send = [](const OutboundValue& value) {
      if (std::holds_alternative<PoseReport>(value)) throw std::runtime_error("no memory");
      return true;
    };
    one.Drive(0, 1);
    EXPECT_TRUE(one.WaitPhase(SessionPhase::kEnded));
  }
  spdlog::set_default_logger(before);
  EXPECT_THAT(kept->last_formatted(), ::testing::Contains(::testing::ContainsRegex("robot 'r1': .*no memory")));
}

// A session that had failed went on taking scans, and each one waited for a turn of the strand only to be dropped
// there.
TEST(Session, AFailedSessionRefusesNewSamplesAtOnce) {
  OneSession one;
  one.on_send = [](const OutboundValue& value) {
    if (std::holds_alternative<PoseReport>(value)) throw std::runtime_error("no memory");
    return true;
  };
  one.Drive(0, 1);
  ASSERT_TRUE(one.WaitPhase(SessionPhase::kEnded));
  EXPECT_TRUE(one.session().ending());
  // While the strand is held, only the arrival itself can have counted these as dropped.
  const auto release = one.HoldStrand();
  const std::uint64_t dropped = one.ledger().dropped_total();
  const std::uint64_t odometry_dropped = one.ledger().odometry_dropped;
  EXPECT_TRUE(one.session().Take(ScanOf("r1", RoomScan(1))));
  one.session().Take(OdometryOf("r1", RoomOdometry(1)));
  EXPECT_EQ(one.ledger().dropped_total(), dropped + 1);
  EXPECT_EQ(one.ledger().odometry_dropped, odometry_dropped + 1);
  EXPECT_EQ(one.ledger().waiting, 0U);
  release->set_value();
}

// The last ledger of a robot that fell silent was lost when the lane was full: its client waited for it for ever.
TEST(Session, ALedgerThatCouldNotBeSentIsSentAtALaterTick) {
  RobotsOptions options;
  options.ledger_rate_hz = 1000.0;
  OneSession one(options);
  bool full = true;
  one.on_send = [&full](const OutboundValue& value) { return !full || !std::holds_alternative<Ledger>(value); };
  one.session().Tick();
  EXPECT_TRUE(one.sent().All<Ledger>().empty());
  full = false;
  EXPECT_TRUE(one.sent().WaitFor([&] {
    one.session().Tick();
    return one.sent().All<Ledger>().size() == 2;  // Of the laser and of the odometry.
  }));
}

TEST(Session, AnExceptionAtItsEndStillEndsIt) {
  OneSession one;
  one.on_send = [thrown = false](const OutboundValue& value) mutable {
    if (std::holds_alternative<SessionState>(value) && !std::exchange(thrown, true)) throw 42;
    return true;
  };
  std::promise<void> done;
  one.session().Suspend([&done] { done.set_value(); });
  ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
  EXPECT_EQ(one.phase(), SessionPhase::kEnded);
}

TEST(Session, AbandonDropsWhatStillWaits) {
  OneSession one;
  const auto release = one.HoldStrand();
  one.Drive(0, 8);
  one.session().Abandon();
  release->set_value();
  ASSERT_TRUE(one.WaitSettled(8));
  EXPECT_EQ(Dropped(one.ledger(), DropReason::kSessionEnded), 8U);
  EXPECT_EQ(one.ledger().waiting, 0U);
}

// What the server's stop drops is sent again to the next server. A checkpoint that counted it would make the next
// server ignore it.
TEST(Session, NoCheckpointHoldsWhatTheServersStopDrops) {
  for (const bool stopping : {false, true}) {
    OneSession one;
    const auto release = one.HoldStrand();
    one.Drive(0, 8);
    std::promise<void> done;
    if (stopping) one.session().Suspend([&done] { done.set_value(); });
    one.session().Abandon();
    one.position = 100;
    release->set_value();
    if (stopping) {
      ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(20)), std::future_status::ready);
      ASSERT_TRUE(one.sent().WaitFor([&] { return !one.session().has_work(); }));
      EXPECT_EQ(Dropped(one.ledger(), DropReason::kSessionEnded), 8U);
      EXPECT_EQ(one.checkpoints, 0);
    } else {
      EXPECT_TRUE(one.sent().WaitFor([&] { return one.checkpoints > 0; }));
    }
  }
}

}  // namespace
}  // namespace cairn::server
