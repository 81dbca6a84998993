// Every value through real Fast DDS, between two participants.
#include "common/wire/bus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <future>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "common/wire/limits.h"
#include "common/wire/partitions.h"
#include "tests/common/wire/sample_values.h"
#include "tests/loopback.h"

namespace cairn::wire {
namespace {

using namespace test;

class BusPair : public ::testing::Test {
 protected:
  template <typename Value>
  void ExpectArrives(const Value& value, int writers = 1) {
    Inbox<Value> inbox;
    const auto subscription = Must(receiver_->Subscribe<Value>(inbox.Sink()));
    const auto publication = Must(sender_->Advertise<Value>());
    ASSERT_TRUE(Eventually([&] { return publication->matched() == writers && subscription->matched() == writers; }));
    const Result<void> published = publication->Publish(value);
    ASSERT_TRUE(published) << published.error().message;
    ASSERT_TRUE(inbox.WaitFor(1));
    EXPECT_TRUE(Same(inbox.values()[0], value));
    EXPECT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    EXPECT_EQ(subscription->refused(), 0U);
  }

  // Honest traffic passes the guard.
  void TearDown() override {
    EXPECT_EQ(sender_->datagrams_refused(), 0U);
    EXPECT_EQ(receiver_->datagrams_refused(), 0U);
  }

  const std::unique_ptr<Bus> sender_ = MakeBus("sender");
  const std::unique_ptr<Bus> receiver_ = MakeBus("receiver");
};

TEST_F(BusPair, CarriesSessionRequests) {
  ExpectArrives(ExtremeSessionRequest());
}
// Whoever invents clients is the same participant.
TEST_F(BusPair, SaysWhichParticipantARequestIsOf) {
  const auto third = MakeBus("third");
  Inbox<Request> inbox;
  const auto subscription = Must(receiver_->Subscribe<Request>(inbox.Sink()));
  const auto first = Must(sender_->Advertise<Request>()), other = Must(third->Advertise<Request>());
  const auto again = Must(sender_->Advertise<Request>());
  ASSERT_TRUE(Eventually([&] {
    return first->matched() == 1 && again->matched() == 1 && other->matched() == 1 && subscription->matched() == 3;
  }));
  Request request;
  for (auto* const writer : {first.get(), again.get(), other.get()}) {
    ++request.client;
    ASSERT_TRUE(writer->Publish(request));
  }
  ASSERT_TRUE(inbox.WaitFor(3));
  std::map<ClientId, std::uint64_t> askers;
  for (const Request& received : inbox.values()) askers[received.client] = received.asker;
  EXPECT_NE(askers[1], 0U);
  EXPECT_EQ(askers[1], askers[2]);
  EXPECT_NE(askers[1], askers[3]);
}

TEST_F(BusPair, CarriesSessionStates) {
  ExpectArrives(ExtremeSessionState());
}
TEST_F(BusPair, CarriesRefusals) {
  ExpectArrives(ExtremeSessionRefusal());
}
TEST_F(BusPair, CarriesScans) {
  ExpectArrives(ExtremeScan(1081));
}
TEST_F(BusPair, CarriesScansOfMoreThanOneDatagram) {
  ExpectArrives(ExtremeScan(kMaxRangesRead));
}
TEST_F(BusPair, CarriesOdometry) {
  ExpectArrives(ExtremeOdometry());
}
TEST_F(BusPair, CarriesPoses) {
  ExpectArrives(ExtremePose(), static_cast<int>(kRobotShares));
}
TEST_F(BusPair, CarriesLedgers) {
  ExpectArrives(ExtremeLedger(), static_cast<int>(kRobotShares));
}
TEST_F(BusPair, CarriesMapInfo) {
  ExpectArrives(ExtremeMapInfo());
}
TEST_F(BusPair, CarriesTiles) {
  ExpectArrives(ExtremeTile(kMaxTileBytes));
}
TEST_F(BusPair, CarriesJobs) {
  ExpectArrives(ExtremeJob());
}
TEST_F(BusPair, CarriesRequests) {
  ExpectArrives(ExtremeRequest());
}
TEST_F(BusPair, CarriesReplies) {
  ExpectArrives(ExtremeReply(), static_cast<int>(kReplyPartitions));
}

TEST_F(BusPair, ALateJoinerGetsTheWholeMap) {
  constexpr int kTiles = 500;
  const auto publication = Must(sender_->Advertise<TileSample>());
  for (int version = 1; version <= 2; ++version) {
    for (int x = 0; x < kTiles; ++x) {
      TileSample sample = ExtremeTile(3000);
      sample.tile.key = {0, x - 250, -x};
      sample.tile.version = static_cast<std::uint64_t>(version);
      ASSERT_TRUE(publication->Publish(sample));
    }
  }
  Inbox<TileSample> inbox;
  const auto subscription = Must(receiver_->Subscribe<TileSample>(inbox.Sink()));
  ASSERT_TRUE(inbox.WaitFor(kTiles));
  const std::vector<TileSample> tiles = inbox.values();
  ASSERT_EQ(tiles.size(), static_cast<std::size_t>(kTiles));
  for (const TileSample& sample : tiles) EXPECT_EQ(sample.tile.version, 2U);
}

TEST_F(BusPair, AClientSeesOnlyItsOwnReplies) {
  constexpr ClientId kOther = 1 + kReplyPartitions;  // In the same partition.
  const auto publication = Must(sender_->Advertise<Reply>());
  Inbox<Reply> mine;
  Inbox<Reply> theirs;
  const auto my_subscription = Must(receiver_->SubscribeReplies(1, mine.Sink()));
  const auto their_subscription = Must(receiver_->SubscribeReplies(kOther, theirs.Sink()));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 2; }));
  for (std::int64_t i = 0; i < 10; ++i) {
    Reply reply = ExtremeReply();
    reply.client = i % 2 == 0 ? 1 : kOther;
    reply.sequence = i;
    ASSERT_TRUE(publication->Publish(reply));
  }
  ASSERT_TRUE(mine.WaitFor(5));
  ASSERT_TRUE(theirs.WaitFor(5));
  for (const Reply& reply : mine.values()) EXPECT_EQ(reply.sequence % 2, 0);
  for (const Reply& reply : theirs.values()) EXPECT_EQ(reply.sequence % 2, 1);
  EXPECT_EQ(my_subscription->refused(), 0U);
}

TEST_F(BusPair, RepliesToOthersAreNotSent) {
  constexpr int kReplies = 3000;
  const std::unique_ptr<Bus> bystander = MakeBus("bystander");
  const auto publication = Must(sender_->Advertise<Reply>());
  Inbox<Reply> mine;
  Inbox<Reply> theirs;
  const auto my_subscription = Must(receiver_->SubscribeReplies(1, mine.Sink()));
  const auto their_subscription = Must(bystander->SubscribeReplies(2, theirs.Sink()));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 2; }));
  ASSERT_TRUE(Eventually([&] { return my_subscription->matched() + their_subscription->matched() == 2; }));
  const std::uint64_t before = bystander->bytes_received();
  const std::uint64_t receiver_before = receiver_->bytes_received();
  Reply reply = ExtremeReply();
  std::size_t to_me = 0;
  for (int i = 0; i < kReplies; ++i) {
    reply.client = i % 1000 == 999 ? 2 : 1;
    reply.sequence = i;
    ASSERT_TRUE(publication->Publish(reply));
    to_me += reply.client == 1 ? 1 : 0;
    if (i % 100 != 0) continue;
    ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    // What is acknowledged waits in the reader, which keeps only so much.
    ASSERT_TRUE(mine.WaitFor(to_me));
  }
  ASSERT_TRUE(mine.WaitFor(kReplies - 3));
  ASSERT_TRUE(theirs.WaitFor(3));
  EXPECT_EQ(mine.values().size(), kReplies - 3U);
  const std::uint64_t to_receiver = receiver_->bytes_received() - receiver_before;
  EXPECT_LT(20 * (bystander->bytes_received() - before), to_receiver);
  EXPECT_GT(to_receiver, kReplies * sizeof(Reply));
  EXPECT_EQ(bystander->datagrams_refused(), 0U);
}

// While every robot was sent the poses of all, the work of a fleet grew with the square of its size.
TEST_F(BusPair, WhatIsAboutOtherRobotsIsNotSent) {
  constexpr std::size_t kPoses = 3000;
  constexpr NameId kMine = 1, kOther = 2, kOfMyShare = kMine + kRobotShares;
  const std::unique_ptr<Bus> bystander = MakeBus("bystander");
  const auto poses = Must(sender_->Advertise<PoseReport>());
  const auto ledgers = Must(sender_->Advertise<Ledger>());
  Inbox<PoseReport> mine, theirs, everybodys;
  Inbox<Ledger> my_ledgers;
  const auto of_me = Must(receiver_->SubscribeRobot<PoseReport>(kMine, mine.Sink()));
  const auto ledgers_of_me = Must(receiver_->SubscribeRobot<Ledger>(kMine, my_ledgers.Sink()));
  const auto of_other = Must(bystander->SubscribeRobot<PoseReport>(kOther, theirs.Sink()));
  ASSERT_TRUE(Eventually([&] { return of_me->matched() + ledgers_of_me->matched() + of_other->matched() == 3; }));
  ASSERT_TRUE(Eventually([&] { return poses->matched() == 2 && ledgers->matched() == 1; }));
  const std::uint64_t before = bystander->bytes_received();
  const std::uint64_t receiver_before = receiver_->bytes_received();
  PoseReport pose = ExtremePose();
  for (std::size_t count = 1; count <= kPoses; ++count) {
    pose.robot_id = kMine;
    ASSERT_TRUE(poses->Publish(pose));
    ASSERT_TRUE(mine.WaitFor(count));  // The writer keeps one of each robot.
  }
  pose.robot_id = kOther;
  ASSERT_TRUE(poses->Publish(pose));
  ASSERT_TRUE(theirs.WaitFor(1));
  const std::uint64_t to_receiver = receiver_->bytes_received() - receiver_before;
  EXPECT_LT(10 * (bystander->bytes_received() - before), to_receiver);

  // A share has more than one robot: the others are left out.
  for (const NameId robot : {kOfMyShare, kMine}) {
    pose.robot_id = robot;
    ASSERT_TRUE(poses->Publish(pose));
    Ledger ledger = ExtremeLedger();
    ledger.robot_id = robot;
    ASSERT_TRUE(ledgers->Publish(ledger));
  }
  ASSERT_TRUE(mine.WaitFor(kPoses + 1));
  ASSERT_TRUE(my_ledgers.WaitFor(1));
  for (const PoseReport& received : mine.values()) EXPECT_EQ(received.robot_id, kMine);
  EXPECT_EQ(my_ledgers.values().front().robot_id, kMine);
  EXPECT_EQ(of_me->refused() + ledgers_of_me->refused(), 0U);

  const auto of_all = Must(bystander->Subscribe<PoseReport>(everybodys.Sink()));
  constexpr int kWriters = kRobotShares;
  ASSERT_TRUE(Eventually([&] { return of_all->matched() == kWriters && poses->matched() == kWriters + 2; }));
  for (const NameId robot : {kMine, kOther, kOfMyShare}) {
    pose.robot_id = robot;
    ASSERT_TRUE(poses->Publish(pose));
  }
  EXPECT_TRUE(everybodys.WaitFor(3));
  EXPECT_EQ(bystander->datagrams_refused(), 0U);
}

TEST_F(BusPair, AReceiverThatThrowsLosesOneSampleOnly) {
  Inbox<PoseReport> inbox;
  const auto keep = inbox.Sink();
  const auto subscription = Must(receiver_->Subscribe<PoseReport>([&](PoseReport&& report) {
    if (report.scan_sequence == 1) throw std::runtime_error("out of memory");
    keep(std::move(report));
  }));
  const auto publication = Must(sender_->Advertise<PoseReport>());
  ASSERT_TRUE(Eventually([&] {
    constexpr int kWriters = kRobotShares;
    return publication->matched() == kWriters && subscription->matched() == kWriters;
  }));
  PoseReport report = ExtremePose();
  for (std::uint64_t sequence = 1; sequence <= 3; ++sequence) {
    report.scan_sequence = sequence;
    ASSERT_TRUE(publication->Publish(report));
    ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    ASSERT_TRUE(Eventually([&] { return inbox.values().size() + subscription->refused() == sequence; }));
  }
  EXPECT_EQ(subscription->refused(), 1U);
  EXPECT_EQ(inbox.values().front().scan_sequence, 2U);
}

TEST_F(BusPair, WhatExceedsTheLimitsIsNotSent) {
  const auto tiles = Must(sender_->Advertise<TileSample>());
  const Result<void> too_long = tiles->Publish(ExtremeTile(kMaxTileBytes + 1));
  ASSERT_FALSE(too_long);
  EXPECT_EQ(too_long.error().code, StatusCode::kOutOfRange);
  TileSample far = ExtremeTile(10);
  far.tile.key.x = 40000;
  EXPECT_FALSE(tiles->Publish(far));
  const auto replies = Must(sender_->Advertise<Reply>());
  Reply huge;
  huge.tiles.assign(10, ExtremeTile(kMaxTileBytes).tile);
  const Result<void> too_many = replies->Publish(huge);
  ASSERT_FALSE(too_many);
  EXPECT_THAT(too_many.error().message, ::testing::HasSubstr("bytes"));
}

TEST_F(BusPair, MatchesAreAnnounced) {
  std::atomic<int> matched = 0;
  SubscriptionEvents events;
  events.matched = [&](int count) { matched = count; };
  const auto subscription = Must(receiver_->Subscribe<Job>([](Job&&) {}, events));
  {
    const auto publication = Must(sender_->Advertise<Job>());
    EXPECT_TRUE(Eventually([&] { return matched == 1; }));
  }
  EXPECT_TRUE(Eventually([&] { return matched == 0; }));
}

// Without a lock around it, Fast DDS 2.9 deadlocks or crashes here.
TEST(Bus, ManyThreadsMakeAndDeleteEndpointsAtOnce) {
  constexpr int kThreads = 40;
  constexpr int kRounds = 5;
  const auto far = MakeBus("far");
  const auto readers = far->Subscribe<Job>([](Job&&) {}, {});
  auto done = std::make_shared<std::promise<void>>();
  auto finished = done->get_future();
  std::thread([done, bus = std::shared_ptr<Bus>(MakeBus("near"))] {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&bus = *bus] {
        for (int round = 0; round < kRounds; ++round) {
          const auto writer = bus.Advertise<Job>();
          const auto jobs = bus.Subscribe<Job>([](Job&&) {}, {});
          const auto poses = bus.Subscribe<PoseReport>([](PoseReport&&) {}, {});
          EXPECT_TRUE(writer && jobs && poses);
        }
      });
    }
    threads.clear();
    done->set_value();
  }).detach();
  if (finished.wait_for(std::chrono::seconds(60)) == std::future_status::ready) return;
  // Threads that wait for one another for ever can only be ended with the process.
  std::fputs("the threads are waiting for one another\n", stderr);
  std::_Exit(1);
}

// The thread that removes the endpoint of a peer waited for the thread of timers, and that one for the other, because
// it wanted to see whether a peer's lease has run out: then nothing arrived any more (library_repairs.cpp). With short
// leases it looks often.
TEST(Bus, EndpointsGoWhileLeasesAreWatched) {
  constexpr int kPeers = 8;
  constexpr int kRounds = 60;
  WireOptions options = LoopbackOptions();
  options.liveliness_lease_s = options.participant_lease_s = 0.1;
  auto done = std::make_shared<std::promise<void>>();
  auto finished = done->get_future();
  std::thread([done, options] {
    {
      const auto watcher = MakeBus("watcher");
      const auto subscription = Must(watcher->Subscribe<Job>([](Job&&) {}));
      std::vector<std::jthread> peers;
      for (int i = 0; i < kPeers; ++i) {
        peers.emplace_back([&, i] {
          const auto peer = MakeBus("peer" + std::to_string(i), options);
          for (int round = 0; round < kRounds; ++round) {
            std::vector<std::unique_ptr<Publication<Job>>> publications;
            for (int k = 0; k < 4; ++k) publications.push_back(Must(peer->Advertise<Job>()));
            EXPECT_TRUE(Eventually([&] { return publications.back()->matched() > 0; }, std::chrono::seconds(2)));
          }
        });
      }
      peers.clear();
      EXPECT_TRUE(Eventually([&] { return subscription->matched() == 0; }));
    }
    done->set_value();  // Nothing of the middleware is left: the process may end.
  }).detach();
  if (finished.wait_for(std::chrono::seconds(90)) == std::future_status::ready) return;
  std::fputs("the threads are waiting for one another\n", stderr);
  std::_Exit(1);
}

TEST(Bus, PublicationsAndSubscriptionsOutliveTheirBus) {
  Inbox<Job> inbox;
  std::unique_ptr<Bus> bus = MakeBus("short-lived");
  const auto subscription = Must(bus->Subscribe<Job>(inbox.Sink()));
  const auto publication = Must(bus->Advertise<Job>());
  bus.reset();
  ASSERT_TRUE(publication->Publish(ExtremeJob()));
  EXPECT_TRUE(inbox.WaitFor(1));
}

}  // namespace
}  // namespace cairn::wire
