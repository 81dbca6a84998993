#include "server/robots/session_record.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "server/robots/stream_ledger.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using std::chrono::milliseconds;
using testing::Dropped;
using testing::kOwner;
using testing::kScans;
using testing::RequestOf;
using Urgency = SessionRecord::Urgency;

const NameId kLaser = HashName("laser");
const StreamId kSonar{HashName("r1"), HashName("sonar"), kOwner};

class SessionRecordTest : public ::testing::Test {
 protected:
  SessionRecordTest() {
    EXPECT_TRUE(record_.AddSensors({"laser"}));
    Take(0, Urgency::kNow);  // The first word of a stream is due at once.
  }
  std::vector<Ledger> Take(int at_ms, Urgency urgency = Urgency::kWhenDue) {
    return record_.TakeDueLedgers(start_ + milliseconds(at_ms), urgency);
  }
  void Receive(std::uint64_t sequence) {
    EXPECT_EQ(record_.ScanReceived(kScans, sequence), SessionRecord::Arrival::kNew);
  }
  void Settle(std::uint64_t sequence) { record_.ScanDropped(kScans, sequence, DropReason::kEmpty); }
  Ledger ledger() const { return record_.snapshot().status.ledgers.at(0); }

  const SessionRecord::Clock::time_point start_ = SessionRecord::Clock::now();
  SessionRecord record_{1, RequestOf("r1"), RobotsOptions{}};  // Ledgers at 10 Hz.
};

TEST_F(SessionRecordTest, ALedgerIsDueAtTheRateAndOnlyWhereSomethingChanged) {
  EXPECT_TRUE(Take(500).empty());
  Receive(1);
  EXPECT_TRUE(Take(50).empty());
  ASSERT_EQ(Take(100).size(), 1U);
  EXPECT_TRUE(Take(300).empty());
}

TEST_F(SessionRecordTest, ABurstOfSettledScansIsDueAtOnce) {
  for (std::uint64_t n = 1; n <= SessionRecord::kSettledBurst; ++n) {
    EXPECT_TRUE(Take(1).empty());
    Receive(n);
    Settle(n);
  }
  const auto due = Take(1);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].settled_through, SessionRecord::kSettledBurst);
  EXPECT_EQ(due[0].sensor, "laser");
  EXPECT_EQ(due[0].site, "lab");
}

// What the robot sends at this moment may arrive before what it sends again.
TEST_F(SessionRecordTest, AfterARestartWhatIsSentAgainComesFirst) {
  for (std::uint64_t number = 1; number <= 3; ++number) {
    Receive(number);
    EXPECT_TRUE(record_.OdometryReceived(kOwner, number));
  }
  record_.Restored();
  ASSERT_TRUE(record_.Resume(kOwner, kOwner));
  EXPECT_EQ(record_.ScanReceived(kScans, 7), SessionRecord::Arrival::kAside);
  EXPECT_FALSE(record_.OdometryReceived(kOwner, 7));
  EXPECT_EQ(record_.ScanReceived(kScans, 3), SessionRecord::Arrival::kDuplicate);
  for (std::uint64_t number = 4; number <= 7; ++number) {
    Receive(number);
    EXPECT_TRUE(record_.OdometryReceived(kOwner, number)) << number;
  }
  EXPECT_EQ(Dropped(ledger(), DropReason::kLostOnWire), 0U);
}

// Forged messages may have stopped the stream before the first sample of this server.
TEST_F(SessionRecordTest, AStreamThatStandsStillAfterARestartIsStale) {
  Receive(1);
  Settle(1);
  slam::StateWriter writer;
  ASSERT_TRUE(record_.Save(writer, {}));
  SessionRecord next{1, RequestOf("r1"), RobotsOptions{}};  // As of a checkpoint: nothing has arrived in this process.
  ASSERT_TRUE(next.AddSensors({"laser"}));
  const std::string bytes = writer.Bytes();
  slam::StateReader reader(bytes);
  ASSERT_TRUE(next.Load(reader, {}));
  next.Restored();
  ASSERT_TRUE(next.Resume(kOwner, kOwner));
  EXPECT_FALSE(next.LookForSilence(SessionRecord::Clock::now()));
  EXPECT_TRUE(next.LookForSilence(SessionRecord::Clock::now() + std::chrono::seconds(2)));
  EXPECT_TRUE(next.state().stale);
}

// A checkpoint may come from a file. A gap without end was walked through for ever, with the lock held.
TEST_F(SessionRecordTest, NumbersThatCannotBeThoseOfAStreamAreRefused) {
  using Gaps = std::vector<std::uint64_t>;
  const auto is_read = [](const Gaps& gaps, std::uint64_t last = 10, std::uint64_t settled = 2,
                          const std::set<std::uint64_t>& waiting = {3}) {
    slam::StateWriter writer;
    const Ledger counts;
    writer(std::uint64_t{5}, std::uint64_t{4}, std::uint64_t{1}, counts.dropped, last, settled, Stamp{7}, true,
           std::uint64_t{1}, std::uint64_t{4}, waiting, gaps);
    const std::string bytes = writer.Bytes();
    slam::StateReader reader(bytes);
    StreamLedger ledger{Ledger{}};
    reader(ledger);
    return reader.ok();
  };
  EXPECT_TRUE(is_read({}));
  EXPECT_TRUE(is_read({4, 4, 5, 9}));
  for (const Gaps& bad : {Gaps{4}, Gaps{0, 4}, Gaps{0, UINT64_MAX}, Gaps{5, 4}, Gaps{4, 10}, Gaps{4, UINT64_MAX},
                          Gaps{4, 6, 6, 7}, Gaps{6, 7, 4, 5}})
    EXPECT_FALSE(is_read(bad)) << ::testing::PrintToString(bad);
  EXPECT_FALSE(is_read({}, UINT64_MAX));
  EXPECT_FALSE(is_read({}, 10, 11));
  EXPECT_FALSE(is_read({}, 10, 2, {0}));
  EXPECT_FALSE(is_read({}, 10, 2, {11}));
}

// A server that is started again every night ended no session ever.
TEST_F(SessionRecordTest, ItIsAwayForAsLongAsBeforeTheRestart) {
  const std::uint64_t now_ms = SessionRecord::MillisecondsNow();
  record_.Restored(now_ms - 5000);
  EXPECT_EQ(record_.quiet_since_ms(), now_ms - 5000);
  const auto now = SessionRecord::Clock::now();
  EXPECT_GE(record_.SuspendedFor(now), milliseconds(5000));
  EXPECT_FALSE(record_.HasHadTime(now));
  EXPECT_TRUE(record_.HasHadTime(now + std::chrono::hours(1)));
  ASSERT_TRUE(record_.Resume(kOwner, kOwner));
  EXPECT_EQ(record_.quiet_since_ms(), 0U);
  ASSERT_TRUE(record_.SetPhase(SessionPhase::kEnded, {}));
  EXPECT_GE(record_.quiet_since_ms(), now_ms);
}

TEST_F(SessionRecordTest, AClockThatWasSetBackMakesNobodyOlder) {
  record_.Restored(SessionRecord::MillisecondsNow() + 3'600'000);
  EXPECT_LT(record_.SuspendedFor(SessionRecord::Clock::now()), milliseconds(60000));
}

TEST_F(SessionRecordTest, AfterARestartBeforeTheFirstSampleTheFirstOneComesFirst) {
  record_.Restored();
  ASSERT_TRUE(record_.Resume(kOwner, kOwner));
  EXPECT_EQ(record_.ScanReceived(kScans, 5), SessionRecord::Arrival::kAside);
  EXPECT_FALSE(record_.OdometryReceived(kOwner, 5));
  for (std::uint64_t number = 1; number <= 5; ++number) {
    Receive(number);
    EXPECT_TRUE(record_.OdometryReceived(kOwner, number)) << number;
  }
}

TEST_F(SessionRecordTest, ANumberFarAheadOfTheRobotIsLeftAsideAndOneOfTheJournalIsNot) {
  constexpr std::uint64_t kFar = std::uint64_t{1} << 32;
  Receive(1);
  EXPECT_TRUE(record_.OdometryReceived(kOwner, 1));
  EXPECT_EQ(record_.ScanReceived(kScans, kFar), SessionRecord::Arrival::kAside);
  EXPECT_FALSE(record_.OdometryReceived(kOwner, kFar));
  EXPECT_EQ(ledger().last_sequence, 1U);
  Receive(2);
  EXPECT_TRUE(record_.OdometryReceived(kOwner, 2));
  EXPECT_EQ(record_.ScanReceived(kScans, kFar, SessionRecord::From::kJournal), SessionRecord::Arrival::kNew);
  EXPECT_TRUE(record_.OdometryReceived(kOwner, kFar, SessionRecord::From::kJournal));
  EXPECT_EQ(ledger().last_sequence, kFar);
}

// A client that replays a log waits for the ledger before it sends more; the end of a burst must not wait for the
// clock.
TEST_F(SessionRecordTest, ADrainedQueueIsDueAtOnceWhereAScanWasSettled) {
  Receive(1);
  EXPECT_TRUE(Take(1, Urgency::kDrained).empty());
  Settle(1);
  EXPECT_EQ(Take(1, Urgency::kDrained).size(), 1U);
  EXPECT_TRUE(Take(1, Urgency::kDrained).empty());
  EXPECT_EQ(Take(1, Urgency::kNow).size(), 2U);  // That of the odometry, too.
}

TEST_F(SessionRecordTest, ALedgerThatCouldNotBeSentIsDueAgain) {
  Receive(1);
  ASSERT_EQ(Take(200).size(), 1U);
  record_.MarkUnsent(kLaser);
  record_.MarkUnsent(HashName("sonar"));  // Nobody's stream: no matter.
  EXPECT_EQ(Take(400).size(), 1U);
}

TEST_F(SessionRecordTest, CountsWhatBecameOfScansAndOdometry) {
  Receive(1);
  Receive(2);
  EXPECT_EQ(record_.ScanReceived(kScans, 2), SessionRecord::Arrival::kDuplicate);
  EXPECT_EQ(record_.ScanReceived(kSonar, 1), SessionRecord::Arrival::kUnknownSensor);
  EXPECT_EQ(record_.ForeignScan(HashName("sonar"), DropReason::kNotOwner), SessionRecord::Arrival::kUnknownSensor);
  EXPECT_EQ(record_.ForeignScan(kLaser, DropReason::kNotOwner), SessionRecord::Arrival::kNew);
  PoseReport pose;
  pose.stamp = 10;
  pose.scan_sequence = 1;
  pose.score = 0.75;
  record_.ScanUsed(kScans, pose, 1010, true, 2.5);
  Settle(2);
  for (std::uint64_t i = 1; i <= 4; ++i) EXPECT_TRUE(record_.OdometryReceived(kOwner, i));
  EXPECT_FALSE(record_.OdometryReceived(kOwner, 2));
  record_.OdometryDropped(kOwner, 1, DropReason::kStampWentBack);
  record_.OdometryDropped(kOwner, 2, DropReason::kBadGeometry);
  record_.OdometryDropped(kOwner, 3, DropReason::kQueueFull);
  record_.OdometryUsed(kOwner, 4, 40);
  const Ledger counted = ledger();
  EXPECT_EQ(counted.received, 3U);
  EXPECT_EQ(counted.used, 1U);
  EXPECT_EQ(counted.keyframes, 1U);
  EXPECT_EQ(counted.waiting, 0U);
  EXPECT_EQ(counted.last_stamp, 10);
  EXPECT_EQ(counted.latency_p50_ms, 2.5);
  EXPECT_EQ(Dropped(counted, DropReason::kNotOwner), 1U);
  EXPECT_EQ(Dropped(counted, DropReason::kEmpty), 1U);
  EXPECT_EQ(counted.odometry_received, 4U);
  EXPECT_EQ(counted.odometry_dropped, 2U);
  EXPECT_EQ(counted.odometry_merged, 1U);
  // The pose is shown by the robot's clock, the path kept by the estimator's.
  EXPECT_EQ(record_.snapshot().status.pose.stamp, 10);
  EXPECT_EQ(record_.snapshot().path.last_stamp(), 1010);
  EXPECT_EQ(record_.snapshot().path.At(1010)->score, 0.75F);
}

TEST_F(SessionRecordTest, OnlyAnotherClientNumbersAnew) {
  Receive(5);
  record_.Resume(kOwner, kOwner);
  EXPECT_EQ(record_.ScanReceived(kScans, 5), SessionRecord::Arrival::kDuplicate);
  EXPECT_EQ(record_.owner(), kOwner);
  record_.SetAlive(false);
  record_.Resume(9, 9);
  EXPECT_EQ(record_.owner(), 9U);
  EXPECT_TRUE(record_.alive());
  EXPECT_EQ(record_.ScanReceived({kScans.robot_id, kLaser, 9}, 1), SessionRecord::Arrival::kNew);
  EXPECT_EQ(Dropped(ledger(), DropReason::kLostOnWire), 0U);
}

// The new client sent 50 scans, was told that all numbers up to 50 had settled, and left: they were those of the client
// before it.
TEST_F(SessionRecordTest, TheLedgerOfANewClientSaysNothingOfTheNumbersOfTheOneBefore) {
  constexpr SessionToken kNext = 9;
  const StreamId next{kScans.robot_id, kLaser, kNext};
  static_cast<void>(record_.SetStored(true));
  for (std::uint64_t number = 1; number <= 5; ++number) {
    Receive(number);
    EXPECT_TRUE(record_.OdometryReceived(kOwner, number));
  }
  Settle(1);
  record_.Resume(kNext, kNext);
  Ledger now = ledger();
  EXPECT_EQ(now.session, kNext);
  EXPECT_EQ(now.last_sequence, 0U);
  EXPECT_EQ(now.settled_through, 0U);
  EXPECT_EQ(now.durable_through, 0U);
  EXPECT_EQ(now.received, 5U);
  EXPECT_EQ(now.waiting, 4U);

  // Both clients have a second and a third scan. That of the earlier one settles first.
  for (std::uint64_t number = 1; number <= 3; ++number) {
    EXPECT_EQ(record_.ScanReceived(next, number), SessionRecord::Arrival::kNew);
    EXPECT_TRUE(record_.OdometryReceived(kNext, number));
  }
  for (std::uint64_t number = 2; number <= 5; ++number) {
    Settle(number);
    record_.OdometryUsed(kOwner, number, 10);
  }
  now = ledger();
  EXPECT_EQ(now.settled_through, 0U);
  EXPECT_EQ(now.last_sequence, 3U);
  EXPECT_EQ(now.waiting, 3U);
  EXPECT_EQ(Take(10'000, Urgency::kNow).front().settled_through, 0U) << "odometry";
  record_.ScanDropped(next, 1, DropReason::kEmpty);
  EXPECT_EQ(ledger().settled_through, 1U);
}

// In the journal, an entry of the earlier client may follow the change.
TEST_F(SessionRecordTest, AScanOfAnEarlierClientIsCountedAndTakesNoNumberOfTheNext) {
  constexpr SessionToken kNext = 9;
  record_.Resume(kNext, kNext);
  Receive(40);
  Settle(40);
  for (std::uint64_t number = 1; number <= 40; ++number)
    EXPECT_EQ(record_.ScanReceived({kScans.robot_id, kLaser, kNext}, number), SessionRecord::Arrival::kNew) << number;
  EXPECT_EQ(ledger().received, 41U);
  EXPECT_EQ(Dropped(ledger(), DropReason::kLostOnWire), 0U);
}

TEST_F(SessionRecordTest, SensorsAreBounded) {
  std::vector<std::string> many;
  for (std::size_t i = 1; i < SessionRecord::kMaxSensors; ++i) many.push_back("s" + std::to_string(i));
  EXPECT_TRUE(record_.AddSensors(many));
  EXPECT_TRUE(record_.AddSensors({"laser", "s3"}));  // Both there already.
  EXPECT_FALSE(record_.AddSensors({"one_more"}));
  EXPECT_EQ(record_.snapshot().status.ledgers.size(), SessionRecord::kMaxSensors);
}

TEST_F(SessionRecordTest, TheTimeAwayBeginsWithTheSuspension) {
  const auto later = SessionRecord::Clock::now() + std::chrono::hours(1);
  EXPECT_EQ(record_.SuspendedFor(later), SessionRecord::Clock::duration::zero());
  EXPECT_TRUE(record_.SetPhase(SessionPhase::kSuspended, {StatusCode::kUnavailable, "away"}));
  EXPECT_EQ(record_.state().status.message, "away");
  const auto away = record_.SuspendedFor(later);
  EXPECT_GT(away, std::chrono::minutes(59));
  EXPECT_TRUE(record_.SetPhase(SessionPhase::kSuspended, {}));  // Said twice: the time goes on.
  EXPECT_EQ(record_.SuspendedFor(later), away);
  EXPECT_TRUE(record_.Resume(kOwner, kOwner));
  EXPECT_EQ(record_.SuspendedFor(later), SessionRecord::Clock::duration::zero());
  EXPECT_EQ(record_.phase(), SessionPhase::kActive);
  EXPECT_TRUE(record_.state().status.ok());
}

TEST_F(SessionRecordTest, AnInheritedAccountGoesOnUnderTheStreamsNames) {
  StreamLedger before{Ledger{}};
  EXPECT_TRUE(before.Received(3));
  before.Dropped(3, DropReason::kNoSession);
  record_.Inherit(kLaser, std::move(before));
  EXPECT_EQ(record_.ScanReceived(kScans, 3), SessionRecord::Arrival::kDuplicate);
  EXPECT_EQ(ledger().robot, "r1");
  EXPECT_EQ(ledger().sensor, "laser");
  EXPECT_EQ(Dropped(ledger(), DropReason::kNoSession), 1U);
}

}  // namespace
}  // namespace cairn::server
