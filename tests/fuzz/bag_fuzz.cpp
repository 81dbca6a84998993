// Bags of ROS 2: a number, then an MCAP file that is read as a drive, or one message of a topic that is decoded. SQLite
// opens files by their names only, and is fuzzed by its makers; damaged databases are in sqlite_file_test.
#include <cmath>

#include "common/bag/mcap_file.h"
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
  const auto summary = ReadRecording(path, {}, [&](LogRecord&& record) {
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
  return scans + odometries > 0;
}

bool RunMessage(std::uint8_t kind, std::string_view bytes) {
  if (kind == 1) return ros2::DecodeLaserScan(bytes).has_value();
  if (kind == 2) return ros2::DecodeOdometry(bytes).has_value();
  const auto message = ros2::DecodeTransforms(bytes);
  ros2::FrameTree tree;
  if (message)
    for (const ros2::Transform& transform : message->transforms) static_cast<void>(tree.Set(transform));
  return message.has_value();
}

bool RunBag(std::string_view input) {
  Pieces pieces(input);
  const std::uint8_t kind = pieces.Take() % 4;
  return kind == 0 ? RunDrive(pieces.rest()) : RunMessage(kind, pieces.rest());
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
  return seeds;
}

const bool kBagTarget = Register({"bag", &RunBag, &SeedsOfBags});

}  // namespace
}  // namespace cairn::fuzz
