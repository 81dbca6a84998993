// Keys come and go for years: a topic's limit of instances bounds those that live, not all that ever were.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "tests/common/wire/sample_values.h"
#include "tests/loopback.h"

namespace cairn::wire {
namespace {

using namespace test;

constexpr std::uint64_t kRobots = 20000;  // The topics allow 4,096 at one time.

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
  const auto subscription = Must(this->receiver_->template Subscribe<TypeParam>([&](TypeParam&&) { ++received; }));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 1 && subscription->matched() == 1; }));
  for (std::uint64_t robot = 1; robot <= kRobots; ++robot) {
    const TypeParam value = OfRobot<TypeParam>(robot);
    ASSERT_TRUE(publication->Publish(value)) << robot;
    // A sample that nobody has acknowledged yet would be lost with its instance.
    if (robot % 64 == 0) {
      ASSERT_TRUE(publication->WaitForAcknowledgement(kDeadline)) << robot << " " << received << " refused " << this->receiver_->datagrams_refused() << " " << this->sender_->datagrams_refused();
      for (std::uint64_t old = robot - 63; old <= robot; ++old)
        ASSERT_TRUE(publication->Retire(OfRobot<TypeParam>(old))) << old;
    }
  }
  EXPECT_TRUE(Eventually([&] { return received == kRobots; })) << received;
  EXPECT_EQ(subscription->refused(), 0U);
}

TYPED_TEST(Keys, ThatAreRetiredAreNotTheirsWhoComeLate) {
  const auto publication = Must(this->sender_->template Advertise<TypeParam>());
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(1)));
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(2)));
  const auto first = publication->Retire(OfRobot<TypeParam>(1));
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_EQ(publication->Retire(OfRobot<TypeParam>(3)).error().code, StatusCode::kNotFound);
  Inbox<TypeParam> inbox;
  const auto subscription = Must(this->receiver_->template Subscribe<TypeParam>(inbox.Sink()));
  ASSERT_TRUE(Eventually([&] { return publication->matched() == 1 && subscription->matched() == 1; }));
  ASSERT_TRUE(publication->Publish(OfRobot<TypeParam>(4)));
  ASSERT_TRUE(Eventually([&] {
    const auto values = inbox.values();
    return std::any_of(values.begin(), values.end(), [](const TypeParam& value) { return KeyOf(value) == 4; });
  }));
  for (const TypeParam& value : inbox.values()) EXPECT_NE(KeyOf(value), 1U);
}

}  // namespace
}  // namespace cairn::wire
