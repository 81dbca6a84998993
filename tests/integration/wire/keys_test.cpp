// Keys come and go for years: a topic's limit of instances bounds those that live, not all that ever were.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

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
