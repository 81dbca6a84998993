// Keys come and go for years: a topic's limit of instances bounds those that live, not all that ever were.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "common/wire/limits.h"
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

template <typename Value>
Value OfRobot(std::uint64_t robot) {
  Value value;
  value.robot_id = robot;
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
  return value.robot_id;
}
std::uint64_t KeyOf(const Job& job) {
  return job.id;
}

using Keyed = ::testing::Types<SessionState, PoseReport, Ledger, Job>;
TYPED_TEST_SUITE(Keys, Keyed);

TYPED_TEST(Keys, ThatAreRetiredMakeRoomForOthers) {
  const auto publication = Must(this->sender_->template Advertise<TypeParam>());
  std::atomic<std::uint64_t> received = 0;
  const auto subscription = Must(this->receiver_->template Subscribe<TypeParam>([&](TypeParam&& value) {
    if (KeyOf(value) != kLasting) ++received;
  }));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 1 && subscription->matched() == 1; }));
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
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 1 && subscription->matched() == 1; }));
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
    ASSERT_TRUE(Eventually([&] { return publication->matched() == 2 && late_subscription->matched() == 1; }));
  } else {
    EXPECT_TRUE(Eventually([&] { return has(kLasting) && has(1); }));
  }
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(2)));
  EXPECT_TRUE(Eventually([&] { return has(2); })) << "the stream goes on";
}

// A reader gets every pose once and in order, also while a new writer takes over.
TEST(Numbers, OfAWriterBeginAnewAndNothingIsLost) {
  const auto sender = MakeBus("sender"), receiver = MakeBus("receiver");
  const auto publication = Must(sender->Advertise<PoseReport>());
  std::atomic<std::uint64_t> last = 0, out_of_order = 0;
  const auto subscription = Must(receiver->Subscribe<PoseReport>([&](PoseReport&& pose) {
    if (pose.scan_sequence != last + 1) ++out_of_order;
    last = pose.scan_sequence;
  }));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 1 && subscription->matched() == 1; }));
  PoseReport pose = OfRobot<PoseReport>(1);
  const std::uint64_t poses = kMostWritten + 5000;
  while (++pose.scan_sequence <= poses) {
    ASSERT_TRUE(publication->Publish(pose));
    // The writer keeps one sample. While the next one is not known to the reader, a later sample would take its place.
    const bool changes = pose.scan_sequence >= kMostWritten && pose.scan_sequence < kMostWritten + 64;
    if (!changes && pose.scan_sequence % 8 != 0) continue;
    // Not Eventually, which looks some hundred times a second only.
    const auto deadline = std::chrono::steady_clock::now() + kDeadline;
    while (last != pose.scan_sequence && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    ASSERT_EQ(last, pose.scan_sequence);
  }
  EXPECT_TRUE(Eventually([&] { return last == poses; }));
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_EQ(publication->matched(), 1);
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
