// Bags are decoded by our own reader of CDR, the wire by Fast CDR: both must read the same from the same bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "common/ros2/cdr_decoding.h"
#include "common/wire/ros2/convert.h"
#include "common/wire/ros2/message_types.h"

namespace cairn::ros2 {
namespace {

template <typename Message>
std::string Encoded(const Message& message) {
  typename MessageType<Message>::Type type;
  wire::Sample<typename MessageType<Message>::Wire> sample;
  sample.value = ToWire(message);
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&sample)());
  EXPECT_TRUE(type.serialize(&sample, &payload));
  return {reinterpret_cast<const char*>(payload.data), payload.length};
}

std::mt19937 random_numbers(7);
double Number() {
  return static_cast<float>(std::uniform_real_distribution<double>(-5.0, 5.0)(random_numbers));
}
std::string Name() {
  return std::string(std::uniform_int_distribution<std::size_t>(0, 20)(random_numbers), 'n');
}
Header SomeHeader() {
  return {std::uniform_int_distribution<Stamp>(0, 2'000'000'000'000'000'000)(random_numbers), Name()};
}
Pose3 SomePose() {
  return {{Number(), Number(), Number()}, {Number(), Number(), Number(), Number()}};
}

TEST(CdrAgreement, ScansOdometryAndTransformsComeBack) {
  for (int round = 0; round < 50; ++round) {
    LaserScan scan{SomeHeader(), Number(), Number(), Number(), Number(), Number(), Number(), {}};
    scan.ranges.resize(static_cast<std::size_t>(round) * 7, 1.5F);
    const auto read = DecodeLaserScan(Encoded(scan));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->header.stamp, scan.header.stamp);
    EXPECT_EQ(read->header.frame, scan.header.frame);
    EXPECT_EQ(read->angle_min, scan.angle_min);
    EXPECT_EQ(read->angle_increment, scan.angle_increment);
    EXPECT_EQ(read->time_increment, scan.time_increment);
    EXPECT_EQ(read->scan_time, scan.scan_time);
    EXPECT_EQ(read->range_min, scan.range_min);
    EXPECT_EQ(read->range_max, scan.range_max);
    EXPECT_EQ(read->ranges, scan.ranges);

    const Odometry odometry{SomeHeader(), Name(), SomePose()};
    const auto moved = DecodeOdometry(Encoded(odometry));
    ASSERT_TRUE(moved) << moved.error().message;
    EXPECT_EQ(moved->header.stamp, odometry.header.stamp);
    EXPECT_EQ(moved->child_frame, odometry.child_frame);
    EXPECT_EQ(moved->pose.translation, odometry.pose.translation);
    EXPECT_EQ(moved->pose.rotation.coeffs(), odometry.pose.rotation.coeffs());

    Transforms message;
    for (int i = 0; i < round % 4; ++i) message.transforms.push_back({SomeHeader(), Name(), SomePose()});
    const auto frames = DecodeTransforms(Encoded(message));
    ASSERT_TRUE(frames) << frames.error().message;
    ASSERT_EQ(frames->transforms.size(), message.transforms.size());
    for (std::size_t i = 0; i < message.transforms.size(); ++i) {
      EXPECT_EQ(frames->transforms[i].header.frame, message.transforms[i].header.frame);
      EXPECT_EQ(frames->transforms[i].child_frame, message.transforms[i].child_frame);
      EXPECT_EQ(frames->transforms[i].T_frame_child.rotation.coeffs(),
                message.transforms[i].T_frame_child.rotation.coeffs());
    }
  }
}

}  // namespace
}  // namespace cairn::ros2
