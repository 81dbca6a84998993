// Messages of Foxglove's: what is written reads back, and recordings of other programs are read as drives.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/bag/foxglove_decoding.h"
#include "common/bag/foxglove_encoding.h"
#include "common/bag/mcap_writer.h"
#include "common/bag/recording.h"
#include "common/ros2/frame_tree.h"
#include "common/ros2/message_checks.h"
#include "common/ros2/scan_conversion.h"
#include "foxglove/messages.pb.h"
#include "tests/must.h"
#include "tests/temp_directory.h"

namespace cairn::bag {
namespace {

using test::Must;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr Stamp kBegin = 1'700'000'000'123'456'789;

Scan TiltedScan(Stamp stamp) {
  return {.sequence = 7,
          .stamp = stamp,
          .angle_first_rad = -0.1,  // No sum of these is exact.
          .angle_step_rad = 0.1,
          .range_min_m = 0.05,
          .range_max_m = 11.7,
          .beam_period_s = 1e-4 / 3.0,
          .tilt_rad = 0.3,
          .T_robot_laser = {0.12, -0.03, 0.7},
          .ranges_m = {1.1F, 2.2F, kNaN, kInfinite, -1.0F, 12.5F, 0.0F, -0.0F}};
}

// Numbers are compared as bytes: NaN is itself, and 0 is not -0.
template <typename Number>
bool SameBytes(const Number& a, const Number& b) {
  return std::memcmp(&a, &b, sizeof(a)) == 0;
}

TEST(Foxglove, DetailsMakeAScanExact) {
  for (const Stamp stamp : {kBegin, Stamp{0}, Stamp{-1}, Stamp{-1'500'000'000}}) {
    const Scan scan = TiltedScan(stamp);
    const Scan details = Must(DecodeScanDetails(EncodeDetails(scan, 99)));
    const ScanMessage message = Must(DecodeFoxgloveScan(EncodeLaserScan(scan, "r1/base")));
    EXPECT_EQ(details.sequence, scan.sequence);
    EXPECT_EQ(details.stamp, stamp);
    EXPECT_EQ(message.scan.header.stamp, stamp);
    EXPECT_EQ(message.scan.header.frame, "r1/base");
    EXPECT_EQ(details.angle_first_rad, scan.angle_first_rad);
    EXPECT_EQ(details.angle_step_rad, scan.angle_step_rad);
    EXPECT_EQ(details.range_min_m, scan.range_min_m);
    EXPECT_EQ(details.range_max_m, scan.range_max_m);
    EXPECT_EQ(details.beam_period_s, scan.beam_period_s);
    EXPECT_EQ(details.tilt_rad, scan.tilt_rad);
    EXPECT_EQ(details.T_robot_laser, scan.T_robot_laser);
    ASSERT_EQ(message.scan.ranges.size(), scan.ranges_m.size());
    for (std::size_t i = 0; i < scan.ranges_m.size(); ++i)
      EXPECT_TRUE(SameBytes(message.scan.ranges[i], scan.ranges_m[i])) << i;
  }
}

TEST(Foxglove, TheMessageAloneShowsTheScanWhereItWas) {
  const Scan scan = TiltedScan(kBegin);
  const ScanMessage message = Must(DecodeFoxgloveScan(EncodeLaserScan(scan, "base")));
  EXPECT_NEAR(message.scan.angle_min, scan.angle_first_rad, 1e-12);
  EXPECT_NEAR(message.scan.angle_increment, scan.angle_step_rad, 1e-12);
  const auto mounting = Must(ros2::MountingOf(Must(ros2::MotionOf(message.T_frame_scan))));
  EXPECT_NEAR(mounting.tilt_rad, scan.tilt_rad, 1e-12);
  EXPECT_NEAR(mounting.T_robot_laser.x, 0.12, 1e-12);
  EXPECT_NEAR(mounting.T_robot_laser.theta, 0.7, 1e-12);
  EXPECT_FALSE(mounting.upside_down);
}

TEST(Foxglove, PosesAndTransformsReadBack) {
  const Pose2 pose{1.5, -2.5, 3.0};
  const Odometry odometry{4, kBegin, pose};
  const Odometry exact = Must(DecodeOdometryDetails(EncodeDetails(odometry, 3)));
  EXPECT_EQ(exact.T_odom_robot, pose);
  EXPECT_EQ(exact.stamp, kBegin);
  const auto in_frame = Must(DecodePoseInFrame(EncodePose(kBegin, "odom", pose)));
  EXPECT_EQ(in_frame.header.frame, "odom");
  EXPECT_NEAR(ros2::PlanarPart(Must(ros2::MotionOf(in_frame.pose))).theta, 3.0, 1e-12);
  const auto transforms = Must(DecodeFrameTransform(EncodeTransform(kBegin, "odom", "base", pose)));
  ASSERT_EQ(transforms.transforms.size(), 1U);
  EXPECT_EQ(transforms.transforms[0].child_frame, "base");
  EXPECT_NEAR(transforms.transforms[0].T_frame_child.translation.y(), -2.5, 1e-12);
}

TEST(Foxglove, AGridShowsWallsAndHidesTheUnknown) {
  const OccupancyImage map{.resolution_m = 0.1,
                           .T_map_origin = {-1.0, 2.0, 0.0},
                           .width = 2,
                           .height = 2,
                           .cells = {0, 100, kUnknownCell, 50}};
  foxglove::Grid grid;
  ASSERT_TRUE(grid.ParseFromString(EncodeGrid(kBegin, "hall/map", map)));
  EXPECT_EQ(grid.frame_id(), "hall/map");
  EXPECT_EQ(grid.column_count(), 2U);
  EXPECT_EQ(grid.row_stride(), 6U);
  EXPECT_EQ(grid.cell_stride(), 3U);
  EXPECT_EQ(grid.pose().position().y(), 2.0);
  EXPECT_EQ(grid.cell_size().x(), 0.1);
  std::vector<std::string> names;
  for (const auto& field : grid.fields()) names.push_back(field.name() + std::to_string(field.offset()));
  EXPECT_THAT(names, ElementsAre("occupancy0", "red1", "green1", "blue1", "alpha2"));
  const std::vector<std::uint8_t> bytes(grid.data().begin(), grid.data().end());
  EXPECT_THAT(bytes, ElementsAre(0, 255, 255, 100, 0, 255, 255, 0, 0, 50, 128, 255));
}

// A reader of MCAP knows the messages only from here.
TEST(Foxglove, DescriptorsAreCompleteAndInOrder) {
  for (const char* schema : {kLaserScanSchema, kGridSchema, kLogSchema, kScanDetailsSchema}) {
    google::protobuf::FileDescriptorSet set;
    ASSERT_TRUE(set.ParseFromString(DescriptorsOf(schema)));
    google::protobuf::DescriptorPool pool;
    for (const auto& file : set.file()) ASSERT_NE(pool.BuildFile(file), nullptr) << file.name();
    ASSERT_NE(pool.FindMessageTypeByName(schema), nullptr) << schema;
  }
}

TEST(Foxglove, WhatIsNoMessageIsAnError) {
  EXPECT_FALSE(DecodeFoxgloveScan("\xff\xff\xff"));
  EXPECT_FALSE(DecodePoseInFrame("\x12\x02\xff\xfe")) << "a name that is no UTF-8";
  EXPECT_FALSE(DecodeFrameTransform(std::string(5 << 20, '\0')));
  foxglove::LaserScan scan;
  scan.mutable_timestamp()->set_seconds(std::numeric_limits<std::int64_t>::max());
  EXPECT_THAT(DecodeFoxgloveScan(scan.SerializeAsString()).error().message, HasSubstr("stamp"));
  scan.mutable_timestamp()->set_seconds(1);
  scan.add_ranges(1e300);
  EXPECT_EQ(Must(DecodeFoxgloveScan(scan.SerializeAsString())).scan.ranges[0], kInfinite);
  for (std::size_t i = 0; i < ros2::kMaxRanges; ++i) scan.add_ranges(1.0);
  EXPECT_THAT(DecodeFoxgloveScan(scan.SerializeAsString()).error().message, HasSubstr("too many ranges"));
  Scan bad;
  bad.T_robot_laser.x = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(DecodeScanDetails(EncodeDetails(bad, 1)));
}

// A recording of another program: Foxglove's messages and nothing of ours.
class FoxgloveRecording : public ::testing::Test {
 protected:
  void Add(const std::string& topic, const char* schema, const std::string& message) {
    const auto [channel, is_new] = channels_.try_emplace(topic);
    if (is_new) {
      const auto id = Must(writer_->AddSchema(schema, kProtobuf, DescriptorsOf(schema)));
      channel->second = Must(writer_->AddChannel(id, topic, kProtobuf));
    }
    ++time_;
    Must(writer_->Write(channel->second, time_, time_, message));
  }
  // Scans in the frame of a lidar that is mounted at `T_base_laser`.
  void AddDrive(bool odometry) {
    for (int i = 0; i < 3; ++i) {
      const Stamp stamp = kBegin + i * 100'000'000;
      const Pose2 pose{0.1 * i, 0.0, 0.02 * i};
      Add("/tf", kTransformSchema, EncodeTransform(stamp, "odom", "base", pose));
      Add("/tf", kTransformSchema, EncodeTransform(stamp, "base", "lidar", {0.3, 0.0, 0.0}));
      if (odometry) Add("/wheels/odometry", kPoseSchema, EncodePose(stamp, "odom", pose));
      Add("/gps", kPoseSchema, EncodePose(stamp, "earth", {7.0, 7.0, 0.0}));
      Scan scan = TiltedScan(stamp);
      scan.tilt_rad = 0.0;
      scan.T_robot_laser = {0.0, 0.1, 0.0};
      Add("/front", kLaserScanSchema, EncodeLaserScan(scan, "lidar"));
    }
  }
  std::vector<Scan> scans_;
  std::vector<Odometry> odometries_;
  LogSummary Read(const LogReaderOptions& options = {}) {
    Must(writer_->Finish());
    scans_.clear();
    odometries_.clear();
    return Must(ReadRecording(path_, options, [&](LogRecord&& record) {
      if (auto* const scan = std::get_if<Scan>(&record)) scans_.push_back(std::move(*scan));
      if (const auto* const odometry = std::get_if<Odometry>(&record)) odometries_.push_back(*odometry);
      return true;
    }));
  }

  const TempDirectory directory_;
  const std::filesystem::path path_ = directory_ / "other.mcap";
  const std::unique_ptr<McapWriter> writer_ = Must(McapWriter::Create(path_));
  std::map<std::string, std::uint16_t> channels_;
  std::uint64_t time_ = 0;
};

TEST_F(FoxgloveRecording, OfAnotherProgramIsReadAsADrive) {
  AddDrive(true);
  const LogSummary summary = Read();
  ASSERT_EQ(scans_.size(), 3U);
  ASSERT_EQ(odometries_.size(), 3U);
  EXPECT_THAT(summary.notes, Contains(HasSubstr("odometry: /wheels/odometry"))) << "the other poses are none";
  EXPECT_NEAR(odometries_[2].T_odom_robot.x, 0.2, 1e-12);
  EXPECT_NEAR(scans_[0].T_robot_laser.x, 0.3, 1e-12) << "the transforms'";
  EXPECT_NEAR(scans_[0].T_robot_laser.y, 0.1, 1e-12) << "and the scan's own";
  EXPECT_NEAR(scans_[0].angle_step_rad, 0.1, 1e-12);
  EXPECT_EQ(scans_[0].range_max_m, 80.0);
  EXPECT_EQ(scans_[0].beam_period_s, 0.0);
  EXPECT_TRUE(ValidateScan(scans_[0]));
}

TEST_F(FoxgloveRecording, WithoutATopicOfOdometryUsesTransforms) {
  AddDrive(false);
  const LogSummary summary = Read({.no_return_m = 10.0});
  EXPECT_THAT(summary.notes, Contains(HasSubstr("transforms from 'odom' to 'base'")));
  ASSERT_EQ(odometries_.size(), 3U);
  EXPECT_NEAR(odometries_[1].T_odom_robot.theta, 0.02, 1e-12);
  ASSERT_EQ(scans_.size(), 3U);
  EXPECT_EQ(scans_[0].range_max_m, 10.0);
  EXPECT_EQ(ClassifyRange(scans_[0].ranges_m[5], 0.0, 10.0), BeamClass::kNoReturn) << "12.5 m";
}

}  // namespace
}  // namespace cairn::bag
