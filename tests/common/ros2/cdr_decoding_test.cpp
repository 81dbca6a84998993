#include "common/ros2/cdr_decoding.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/ros2/message_checks.h"
#include "tests/common/bag/bag_writer.h"

namespace cairn::ros2 {
namespace {

using recorded::CdrOf;
using recorded::CdrText;

LaserScan SomeScan() {
  LaserScan scan;
  scan.header = {5 * kNanosPerSecond + 7, "laser"};
  scan.angle_min = -0.5;
  scan.angle_increment = 0.25;
  scan.time_increment = 0.125;
  scan.scan_time = 0.5;
  scan.range_min = 0.0625;
  scan.range_max = 12.0;
  scan.ranges = {1.0F, 2.0F, 3.0F};
  return scan;
}

TEST(CdrDecoding, ReadsEveryField) {
  const auto scan = DecodeLaserScan(CdrOf(SomeScan()));
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->header.stamp, 5 * kNanosPerSecond + 7);
  EXPECT_EQ(scan->header.frame, "laser");
  EXPECT_EQ(scan->angle_min, -0.5);
  EXPECT_EQ(scan->angle_increment, 0.25);
  EXPECT_EQ(scan->time_increment, 0.125);
  EXPECT_EQ(scan->scan_time, 0.5);
  EXPECT_EQ(scan->range_min, 0.0625);
  EXPECT_EQ(scan->range_max, 12.0);
  EXPECT_EQ(scan->ranges, (std::vector<float>{1.0F, 2.0F, 3.0F}));

  const Pose3 pose{{1.0, 2.0, 3.0}, {0.5, -0.5, 0.5, -0.5}};
  const auto odometry = DecodeOdometry(CdrOf(Odometry{{1, "/odom"}, "base", pose}));
  ASSERT_TRUE(odometry);
  EXPECT_EQ(odometry->header.frame, "odom") << "without the slash of old programs";
  EXPECT_EQ(odometry->child_frame, "base");
  EXPECT_EQ(odometry->pose.translation, pose.translation);
  EXPECT_EQ(odometry->pose.rotation.coeffs(), pose.rotation.coeffs());

  // Names of every length: what follows is aligned differently.
  for (std::size_t length = 0; length < 9; ++length) {
    Transforms message;
    message.transforms = {{{3, std::string(length, 'p')}, std::string(length / 2, 'c'), pose}, {{4, "a"}, "b", pose}};
    const auto transforms = DecodeTransforms(CdrOf(message));
    ASSERT_TRUE(transforms);
    ASSERT_EQ(transforms->transforms.size(), 2U);
    EXPECT_EQ(transforms->transforms[0].header.frame.size(), length);
    EXPECT_EQ(transforms->transforms[1].child_frame, "b");
    EXPECT_EQ(transforms->transforms[1].T_frame_child.translation, pose.translation);
  }
}

TEST(CdrDecoding, ReadsTheOtherByteOrder) {
  // Seconds, nanoseconds, "l", seven floats and one range, big-endian.
  std::string bytes(
      "\0\0\0\0"
      "\0\0\0\5"
      "\0\0\0\7"
      "\0\0\0\2"
      "l\0\0\0",
      20);
  for (int i = 0; i < 7; ++i) bytes += std::string("\x40\0\0\0", 4);
  bytes += std::string(
      "\0\0\0\1"
      "\x3f\x80\0\0"
      "\0\0\0\0",
      12);
  const auto scan = DecodeLaserScan(bytes);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->header.stamp, 5 * kNanosPerSecond + 7);
  EXPECT_EQ(scan->header.frame, "l");
  EXPECT_EQ(scan->range_max, 2.0);
  EXPECT_EQ(scan->ranges, std::vector<float>{1.0F});
}

TEST(CdrDecoding, RefusesWhatIsCutOff) {
  const std::string scan = CdrOf(SomeScan());
  for (std::size_t bytes = 0; bytes < scan.size() - 4; ++bytes)
    EXPECT_FALSE(DecodeLaserScan(scan.substr(0, bytes))) << bytes;
  Transforms message;
  message.transforms = {{{3, "p"}, "c", {}}};
  const std::string transforms = CdrOf(message);
  for (std::size_t bytes = 0; bytes < transforms.size(); ++bytes)
    EXPECT_FALSE(DecodeTransforms(transforms.substr(0, bytes))) << bytes;
}

TEST(CdrDecoding, RefusesWhatItsLengthsAndNamesSay) {
  std::string encoded_otherwise = CdrOf(SomeScan());
  encoded_otherwise[1] = 3;  // A parameter list.
  EXPECT_FALSE(DecodeLaserScan(encoded_otherwise));
  CdrText huge;  // Four thousand million ranges.
  huge.Add(Header{1, "laser"});
  for (int i = 0; i < 7; ++i) huge.Add(1.0F);
  huge.Add(0xffffffffU);
  EXPECT_FALSE(DecodeLaserScan(huge.bytes()));
  EXPECT_FALSE(DecodeTransforms(CdrText().Add(0x10000000U).bytes()));
  LaserScan scan = SomeScan();
  scan.ranges.resize(kMaxRanges + 1);
  EXPECT_FALSE(DecodeLaserScan(CdrOf(scan)));
  scan = SomeScan();
  scan.header.frame = "two words";
  EXPECT_FALSE(DecodeLaserScan(CdrOf(scan)));
  scan.header.frame = std::string(kMaxFrameBytes + 1, 'x');
  EXPECT_FALSE(DecodeLaserScan(CdrOf(scan)));
  CdrText late;
  late.Add(1).Add(1'000'000'000U);
  EXPECT_FALSE(DecodeLaserScan(late.bytes() + CdrOf(SomeScan()).substr(12)));
}

}  // namespace
}  // namespace cairn::ros2
