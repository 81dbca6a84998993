// Recordings: a number, then an MCAP file that is read as a drive, one that was compressed as a whole, or one message
// of a topic that is decoded: of ROS 2, of Foxglove, or of a recording of our own. SQLite opens files by their names
// only, and is fuzzed by its makers; damaged databases are in sqlite_file_test.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/bag/foxglove_decoding.h"
#include "common/bag/foxglove_encoding.h"
#include "common/bag/mcap_file.h"
#include "common/bag/mcap_writer.h"
#include "common/bag/packed_file.h"
#include "common/bag/recording.h"
#include "common/ros2/cdr_decoding.h"
#include "common/ros2/frame_tree.h"
#include "tests/common/bag/bag_writer.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/memory_file.h"

namespace cairn::fuzz {
namespace {

constexpr bag::McapLimits kSmallLimits = {.chunk_bytes = 1 << 20, .open_bytes = 4 << 20, .unpacked_bytes = 4 << 20};

bool RunDrive(std::string_view bytes) {
  static const MemoryFile file;
  const std::filesystem::path path = file.With(bytes);
  // First with limits that keep the round short. What passes them is read once more, as a program reads it.
  const auto opened = bag::OpenMcap(path, kSmallLimits);
  if (!opened) {
    Must(!opened.error().message.empty(), "a refusal has a reason");
    return false;
  }
  int scans = 0, odometries = 0;
  std::size_t most = 0;  // The lidars' numbers.
  const auto summary = ReadLidars(path, {.all_lidars = true}, [&](LogRecord&& record, std::size_t lidar) {
    most = std::max(most, lidar);
    if (const auto* const odometry = std::get_if<Odometry>(&record)) {
      ++odometries;
      Must(odometry->T_odom_robot.IsFinite(), "odometry is a pose");
    } else {
      ++scans;
      Must(std::get<Scan>(record).T_robot_laser.IsFinite(), "a scan has a place");
      static_cast<void>(ValidateScan(std::get<Scan>(record)));
    }
    return true;
  });
  if (!summary) {
    Must(!summary.error().message.empty(), "a refusal has a reason");
    return false;
  }
  Must(summary->scans == scans && summary->odometries == odometries, "the summary counts every record");
  Must(most < summary->lidars.size(), "the summary names every lidar");
  return scans + odometries > 0;
}

// A small one: unpacking a large one takes the time of many rounds.
bool RunPacked(std::string_view bytes) {
  static const MemoryFile file;
  const auto opened = bag::OpenPacked(file.With(bytes), {.bytes = 1 << 20, .times_length = 1});
  if (!opened) {
    Must(!opened.error().message.empty(), "a refusal has a reason");
    return false;
  }
  std::vector<std::size_t> wanted((*opened)->topics().size());
  std::iota(wanted.begin(), wanted.end(), std::size_t{0});
  std::size_t count = 0;
  const auto read = (*opened)->Read(wanted, [&](std::size_t topic, std::string_view) {
    Must(topic < wanted.size(), "a message is of a topic");
    ++count;
    return true;
  });
  Must(read || !read.error().message.empty(), "a refusal has a reason");
  return count > 0;
}

bool TakeTransforms(const Result<ros2::Transforms>& message) {
  ros2::FrameTree tree;
  if (message)
    for (const ros2::Transform& transform : message->transforms) static_cast<void>(tree.Set(transform));
  return message.has_value();
}

bool RunMessage(std::uint8_t kind, std::string_view bytes) {
  switch (kind) {
    case 1:
      return ros2::DecodeLaserScan(bytes).has_value();
    case 2:
      return ros2::DecodeOdometry(bytes).has_value();
    case 3:
      return TakeTransforms(ros2::DecodeTransforms(bytes));
    case 4: {
      const auto message = bag::DecodeFoxgloveScan(bytes);
      return message && ros2::MotionOf(message->T_frame_scan);
    }
    case 5: {
      const auto message = bag::DecodePoseInFrame(bytes);
      return message && ros2::MotionOf(message->pose);
    }
    case 6:
      return TakeTransforms(bag::DecodeFrameTransform(bytes));
    case 7:
      return TakeTransforms(bag::DecodeFrameTransforms(bytes));
    case 8: {
      // What is decoded is written again as the same value.
      const auto scan = bag::DecodeScanDetails(bytes);
      if (!scan) return false;
      const std::string again = bag::EncodeDetails(*scan, 0);
      const auto twice = bag::DecodeScanDetails(again);
      Must(twice && bag::EncodeDetails(*twice, 0) == again, "details of a scan read back");
      return true;
    }
    case 9: {
      const auto odometry = bag::DecodeOdometryDetails(bytes);
      Must(!odometry || odometry->T_odom_robot.IsFinite(), "odometry is a pose");
      return odometry.has_value();
    }
    default:
      return RunPacked(bytes);
  }
}

bool RunBag(std::string_view input) {
  constexpr std::uint8_t kKinds = 11;
  Pieces pieces(input);
  const std::uint8_t kind = pieces.Take() % kKinds;
  return kind == 0 ? RunDrive(pieces.rest()) : RunMessage(kind, pieces.rest());
}

// A recording as `cairn record` writes it, and the messages in it.
void AddSeedsOfRecordings(std::vector<std::string>& seeds) {
  Scan scan;
  scan.stamp = kNanosPerSecond;
  scan.angle_step_rad = 0.5;
  scan.range_max_m = 10.0;
  scan.beam_period_s = 0.001;
  scan.tilt_rad = 0.1;
  scan.T_robot_laser = {0.2, 0.0, 0.1};
  scan.ranges_m = {1.0F, 2.0F, 3.0F};
  const Odometry odometry{1, kNanosPerSecond, {1.0, 0.0, 0.1}};
  const std::string scan_details = bag::EncodeDetails(scan, 3), odometry_details = bag::EncodeDetails(odometry, 3);
  const std::string seen = bag::EncodeLaserScan(scan, "r/base");
  const std::string pose = bag::EncodePose(odometry.stamp, "r/odom", odometry.T_odom_robot);
  const std::string transform = bag::EncodeTransform(odometry.stamp, "r/odom", "r/base", odometry.T_odom_robot);
  const std::string transforms = std::string("\x0a") + static_cast<char>(transform.size()) + transform;
  char kind = 4;
  for (const std::string& message : {seen, pose, transform, transforms, scan_details, odometry_details})
    seeds.push_back(kind++ + message);

  struct Written {
    const char* topic;
    const char* schema;
    const std::string& message;
  };
  const std::vector<Written> all = {{"/r/scan/l/details", bag::kScanDetailsSchema, scan_details},
                                    {"/r/scan/l", bag::kLaserScanSchema, seen},
                                    {"/r/tf", bag::kTransformSchema, transform},
                                    {"/tf", bag::kTransformsSchema, transforms},
                                    {"/r/odometry/details", bag::kOdometryDetailsSchema, odometry_details},
                                    {"/r/odometry", bag::kPoseSchema, pose}};
  // With everything, without the details, and with transforms only.
  for (const std::string& without : {std::string("none"), std::string("details"), std::string("odometry")}) {
    const MemoryFile file;
    const auto path = file.With("");
    auto writer = bag::McapWriter::Create(path, {.overwrite = true});
    Must(writer.has_value(), "a file in memory is written");
    for (const Written& one : all) {
      if (std::string(one.topic).find(without) != std::string::npos) continue;
      const auto schema = (*writer)->AddSchema(one.schema, bag::kProtobuf, "");
      const auto channel = (*writer)->AddChannel(*schema, one.topic, bag::kProtobuf);
      Must((*writer)->Write(*channel, 1, 1, one.message).has_value(), "a message is written");
    }
    Must((*writer)->Finish().has_value(), "the file is finished");
    seeds.push_back(std::string(1, '\0') + file.Read());
  }
}

std::vector<std::string> SeedsOfBags() {
  ros2::LaserScan scan;
  scan.header = {kNanosPerSecond, "laser"};
  scan.angle_increment = 0.5;
  scan.time_increment = 0.001;
  scan.range_max = 10.0;
  scan.ranges = {1.0F, 2.0F, 3.0F};
  const ros2::Odometry odometry{{kNanosPerSecond, "odom"}, "base_link", {}};
  ros2::Transforms frames;
  frames.transforms = {recorded::Link("base_link", "laser", {0.2, 0.0, 0.0}),
                       recorded::Link("odom", "base_link", {1.0, 0.0, 0.1}, kNanosPerSecond)};
  const std::string scan_bytes = recorded::CdrOf(scan), odometry_bytes = recorded::CdrOf(odometry),
                    frame_bytes = recorded::CdrOf(frames);
  const recorded::BagMessage mounting{"/tf_static", recorded::kTransformType, 1, frame_bytes},
      moving{"/tf", recorded::kTransformType, 2, frame_bytes},
      moved{"/odom", recorded::kOdometryType, 4, odometry_bytes}, seen{"/scan", recorded::kScanType, 3, scan_bytes},
      packed{"/scan", recorded::kScanType, 5, recorded::PackZstd(scan_bytes)};
  std::vector<std::string> seeds = {'\1' + scan_bytes, '\2' + odometry_bytes, '\3' + frame_bytes};
  for (const char* compression : {"", "lz4", "zstd"})
    for (const std::size_t per_chunk : {0, 2})
      for (const bool as_transform : {false, true})
        seeds.push_back(std::string(1, '\0') + recorded::McapOf({mounting, as_transform ? moving : moved, seen, packed},
                                                                compression, per_chunk));
  // Two lidars of one robot, and files that were compressed as a whole, in one frame and in two.
  ros2::LaserScan other = scan;
  other.header.frame = "rear";
  ros2::Transforms other_frames;
  other_frames.transforms = {recorded::Link("base_link", "rear", {-0.2, 0.0, 3.0})};
  const recorded::BagMessage other_mounting{"/tf_static", recorded::kTransformType, 1, recorded::CdrOf(other_frames)},
      seen_by_other{"/rear/scan", recorded::kScanType, 4, recorded::CdrOf(other)};
  seeds.push_back(std::string(1, '\0') +
                  recorded::McapOf({mounting, other_mounting, moved, seen, seen_by_other}, "zstd", 2));
  const std::string whole = recorded::McapOf({mounting, moved, seen}, "", 0);
  seeds.push_back('\12' + recorded::PackZstd(whole));
  seeds.push_back('\12' + recorded::PackZstd(whole.substr(0, 100)) + recorded::PackZstd(whole.substr(100)));
  AddSeedsOfRecordings(seeds);
  return seeds;
}

const bool kBagTarget = Register({"bag", &RunBag, &SeedsOfBags});

}  // namespace
}  // namespace cairn::fuzz
