// Keys come and go for years: a topic's limit of instances bounds those that live, not all that ever were.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <utility>

#include "common/wire/partitions.h"
#include "common/wire/rtps_datagram.h"
#include "tests/common/wire/sample_values.h"
#include "tests/loopback.h"

namespace cairn::wire {
namespace {

using namespace test;

constexpr std::uint64_t kRobots = 20000;  // The topics allow 4,096 or 16,384 at one time.
constexpr std::uint64_t kLasting = 999'999;

template <typename Value>
class Keys : public ::testing::Test {
 protected:
  const std::unique_ptr<Bus> sender_ = MakeBus("sender");
  const std::unique_ptr<Bus> receiver_ = MakeBus("receiver");
};

// Of one share, so that one writer has all of them.
template <typename Value>
Value OfRobot(std::uint64_t robot) {
  Value value;
  value.robot_id = kRobotShares * robot;
  return value;
}
template <>
Job OfRobot<Job>(std::uint64_t robot) {
  Job value;
  value.id = robot;
  return value;
}
template <typename Value>
std::uint64_t KeyOf(const Value& value) {
  return value.robot_id / kRobotShares;
}
std::uint64_t KeyOf(const Job& job) {
  return job.id;
}

// That a reader of everything matches.
template <typename Value>
constexpr int kWriters = std::is_same_v<Value, PoseReport> || std::is_same_v<Value, Ledger> ? int{kRobotShares} : 1;

using Keyed = ::testing::Types<SessionState, PoseReport, Ledger, Job>;
TYPED_TEST_SUITE(Keys, Keyed);

TYPED_TEST(Keys, ThatAreRetiredMakeRoomForOthers) {
  const auto publication = Must(this->sender_->template Advertise<TypeParam>());
  std::atomic<std::uint64_t> received = 0;
  const auto subscription = Must(this->receiver_->template Subscribe<TypeParam>([&](TypeParam&& value) {
    if (KeyOf(value) != kLasting) ++received;
  }));
  ASSERT_TRUE(Eventually(
      [&] { return publication->matched() == kWriters<TypeParam> && subscription->matched() == kWriters<TypeParam>; }));
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(kLasting)));
  std::uint64_t robot = 1;
  for (; robot <= kRobots; ++robot) {
    const TypeParam value = OfRobot<TypeParam>(robot);
    // A new writer takes over as soon as it has found the reader.
    ASSERT_TRUE(Eventually([&] { return publication->Publish(value).has_value(); })) << robot;
    if (robot % 512 == 0) {
      ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    }
    ASSERT_TRUE(publication->Retire(value)) << robot;
  }
  EXPECT_EQ(publication->Retire(OfRobot<TypeParam>(robot)).error().code, StatusCode::kNotFound);
  EXPECT_TRUE(Eventually([&] { return received >= kRobots; })) << received;
  EXPECT_EQ(subscription->refused(), 0U);
  if constexpr (!std::is_same_v<TypeParam, PoseReport>) {
    Inbox<TypeParam> late;
    const auto late_subscription = Must(this->receiver_->template Subscribe<TypeParam>(late.Sink()));
    EXPECT_TRUE(Eventually([&] {
      const auto values = late.values();
      return std::any_of(values.begin(), values.end(), [](const TypeParam& v) { return KeyOf(v) == kLasting; });
    })) << "what lives outlives the writers";
  }
}

// The last ledger of a robot that has left is kept while the others go on, so that many numbers are left out behind it.
TYPED_TEST(Keys, ALateJoinerGetsWhatWasWrittenLongAgo) {
  const auto publication = Must(this->sender_->template Advertise<TypeParam>());
  Inbox<TypeParam> first;
  const auto subscription = Must(this->receiver_->template Subscribe<TypeParam>(first.Sink()));
  ASSERT_TRUE(Eventually(
      [&] { return publication->matched() == kWriters<TypeParam> && subscription->matched() == kWriters<TypeParam>; }));
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(kLasting)));
  for (std::int64_t count = 1; count <= 2 * kMaxGap; ++count) {
    ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(1)));
    if (count % 512 == 0) {
      ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    }
  }
  // A participant of its own, whose guard has seen no number of the writer before.
  const auto late_bus = MakeBus("late");
  Inbox<TypeParam> late;
  const auto late_subscription = Must(late_bus->template Subscribe<TypeParam>(late.Sink()));
  const auto has = [&](std::uint64_t key) {
    const auto values = late.values();
    return std::any_of(values.begin(), values.end(), [&](const TypeParam& v) { return KeyOf(v) == key; });
  };
  if constexpr (std::is_same_v<TypeParam, PoseReport>) {  // A topic without history.
    ASSERT_TRUE(Eventually([&] {
      return publication->matched() == 2 * kWriters<TypeParam> && late_subscription->matched() == kWriters<TypeParam>;
    }));
  } else {
    EXPECT_TRUE(Eventually([&] { return has(kLasting) && has(1); }));
  }
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(2)));
  EXPECT_TRUE(Eventually([&] { return has(2); })) << "the stream goes on";
}

// A writer puts as many samples into a datagram as fit. Where that left less room than the statistics need which Fast
// DDS adds, the datagram was refused each time that it was sent again: a client that joined late never had the map.
// With tiles of so many sizes it happened in each of three runs.
TEST(Tiles, OfEverySizeReachALateJoiner) {
  constexpr int kTiles = 3000;
  const auto sender = MakeBus("sender");
  const auto publication = Must(sender->Advertise<TileSample>());
  std::mt19937_64 random(3);
  for (int i = 0; i < kTiles; ++i) {
    TileSample sample;
    sample.site_id = 1;
    sample.tile.key = {0, i % 100, i / 100};
    sample.tile.version = static_cast<std::uint64_t>(i) + 1;
    sample.tile.encoding = TileEncoding::kPng;
    sample.tile.bytes.resize(3000 + random() % 6000);
    ASSERT_TRUE(publication->Publish(sample));
  }
  const auto late = MakeBus("late");
  std::atomic<int> received = 0;
  const auto subscription = Must(late->Subscribe<TileSample>([&](TileSample&&) { ++received; }));
  EXPECT_TRUE(Eventually([&] { return received == kTiles; })) << received;
  EXPECT_EQ(late->datagrams_refused(), 0U) << late->refused_by_reason();
}

// With each of its heartbeats, a writer names all numbers that it has left out. They must not cost a reader more and
// more: a reader that needs longer than the time between two heartbeats acknowledges nothing any more.
TEST(Numbers, ThatWereLeftOutBeforeCostNothing) {
  const auto sender = MakeBus("sender"), receiver = MakeBus("receiver");
  const auto publication = Must(sender->Advertise<Ledger>());
  const auto subscription = Must(receiver->Subscribe<Ledger>([](Ledger&&) {}));
  ASSERT_TRUE(Eventually(
      [&] { return publication->matched() == kWriters<Ledger> && subscription->matched() == kWriters<Ledger>; }));
  ASSERT_TRUE(publication->Publish(OfRobot<Ledger>(kLasting)));
  constexpr int kSamples = 50;
  const auto processor_time = [&] {
    const std::clock_t begin = std::clock();
    for (int i = 0; i < kSamples; ++i) {
      EXPECT_TRUE(publication->Publish(OfRobot<Ledger>(1)));
      EXPECT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    }
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  };
  const double before = processor_time();
  for (std::int64_t count = 1; count <= 4 * kMaxGap; ++count) {
    ASSERT_TRUE(publication->Publish(OfRobot<Ledger>(1)));
    if (count % 512 == 0) {
      ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    }
  }
  const double after = processor_time();
  std::printf("%d samples, each acknowledged: %.3f s, with %d numbers left out %.3f s\n", kSamples, before,
              static_cast<int>(4 * kMaxGap), after);
  EXPECT_LT(after, 5 * before);
}

constexpr std::uint64_t kFew = 500;

WireOptions OfFewNumbers() {
  WireOptions options = LoopbackOptions();
  options.most_written = kFew;
  return options;
}

// A reader gets every pose once and in order, also while a new writer takes over.
TEST(Numbers, OfAWriterBeginAnewAndNothingIsLost) {
  const auto sender = MakeBus("sender", OfFewNumbers()), receiver = MakeBus("receiver");
  const auto publication = Must(sender->Advertise<PoseReport>());
  std::atomic<std::uint64_t> last = 0, out_of_order = 0;
  const auto subscription = Must(receiver->Subscribe<PoseReport>([&](PoseReport&& pose) {
    if (pose.scan_sequence != last + 1) ++out_of_order;
    last = pose.scan_sequence;
  }));
  ASSERT_TRUE(Eventually([&] {
    return publication->matched() == kWriters<PoseReport> && subscription->matched() == kWriters<PoseReport>;
  }));
  PoseReport pose = OfRobot<PoseReport>(1);
  const std::uint64_t poses = 5 * kFew;
  while (++pose.scan_sequence <= poses) {
    ASSERT_TRUE(publication->Publish(pose));
    // The writer keeps one sample. While the next writer is not known to the reader, a later sample would take its
    // place. Not Eventually, which looks some hundred times a second only.
    const auto deadline = std::chrono::steady_clock::now() + kDeadline;
    while (last != pose.scan_sequence && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    ASSERT_EQ(last, pose.scan_sequence);
  }
  EXPECT_TRUE(Eventually([&] { return last == poses; }));
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_EQ(publication->matched(), kWriters<PoseReport>);
}

TileSample ChangeOf(NameId site, int x, std::uint64_t version, bool deleted = false) {
  TileSample sample{.site_id = site, .tile = {}, .deleted = deleted};
  sample.tile.key = {.level = 0, .x = x, .y = 0};
  sample.tile.version = version;
  return sample;
}

// Whoever comes late must not have to count all numbers that the server has ever used, nor the tiles that it has
// deleted.
TEST(Numbers, OfTilesBeginAnewWithoutTheDeletedOnes) {
  constexpr NameId kSite = 1, kDeletedSite = 2;
  constexpr int kTiles = 10;
  const auto sender = MakeBus("sender", OfFewNumbers()), receiver = MakeBus("receiver");
  const auto publication = Must(sender->Advertise<TileSample>());
  std::mutex mutex;
  std::map<std::pair<NameId, int>, TileSample> known;  // By site and x; the newest of each.
  const auto subscription = Must(receiver->Subscribe<TileSample>([&](TileSample&& sample) {
    const std::lock_guard lock(mutex);
    TileSample& newest = known[{sample.site_id, sample.tile.key.x}];
    if (sample.tile.version >= newest.tile.version) newest = std::move(sample);
  }));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 1 && subscription->matched() == 1; }));
  std::uint64_t version = 0;
  const auto publish = [&](NameId site, int x, bool deleted = false) {
    ASSERT_TRUE(publication->Publish(ChangeOf(site, x, ++version, deleted)));
    if (version % 16 == 0) {
      ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));
    }
  };
  for (int x = 0; x < kTiles; ++x) {
    publish(kSite, x);
    publish(kDeletedSite, x);
  }
  publish(kSite, 0, true);
  for (int x = 0; x < kTiles; ++x) publish(kDeletedSite, x, true);
  const std::uint64_t newest_of_deleted = version;
  while (version < 3 * kFew) publish(kSite, 1 + static_cast<int>(version % (kTiles - 1)));
  ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline));

  Inbox<TileSample> late;
  const auto late_bus = MakeBus("late");
  const auto late_subscription = Must(late_bus->Subscribe<TileSample>(late.Sink()));
  ASSERT_TRUE(late.WaitFor(kTiles));
  publish(kSite, 1);
  ASSERT_TRUE(late.WaitFor(kTiles + 1));
  for (const TileSample& sample : late.values()) {
    if (!sample.deleted) continue;
    EXPECT_EQ(sample.site_id, kDeletedSite) << "there are newer changes of this site";
    EXPECT_EQ(sample.tile.version, newest_of_deleted);
  }
  EXPECT_EQ(late.values().size(), kTiles + 1U)
      << "nine tiles, the last deletion of the other site, and the last change";
  EXPECT_TRUE(Eventually([&] {
    const std::lock_guard lock(mutex);
    return known[{kSite, 1}].tile.version == version;
  }));
  for (const auto& [place, sample] : known)
    EXPECT_EQ(sample.deleted, place.first == kDeletedSite || place.second == 0) << place.second;
}

TYPED_TEST(Keys, ThatLiveKeepTheirPlaces) {
  const auto publication = Must(this->sender_->template Advertise<TypeParam>());
  std::uint64_t robot = 1;
  while (publication->Publish(OfRobot<TypeParam>(robot)) && robot < kRobots) ++robot;
  ASSERT_LT(robot, kRobots);
  EXPECT_FALSE(publication->Publish(OfRobot<TypeParam>(robot)));
  ASSERT_TRUE(publication->Retire(OfRobot<TypeParam>(robot / 2)));
  EXPECT_TRUE(Eventually([&] { return publication->Publish(OfRobot<TypeParam>(robot)).has_value(); }));
  // A new writer of a topic without history begins empty.
  EXPECT_EQ(publication->Publish(OfRobot<TypeParam>(robot / 2)).has_value(), (std::is_same_v<TypeParam, PoseReport>));
}

}  // namespace
}  // namespace cairn::wire
