// Files of a robot's drive: a number, then a log, a trajectory or a cloud of points. Records of a log go on as a robot
// would send them, into a small estimator.
#include <cmath>

#include "common/cloud/cloud_builder.h"
#include "common/cloud/cloud_file.h"
#include "common/sensor/carmen_writer.h"
#include "common/sensor/log_reader.h"
#include "common/sensor/trajectory.h"
#include "server/slam/scan_pipeline.h"
#include "tests/fuzz/memory_file.h"
#include "tests/temp_directory.h"

namespace cairn::fuzz {
namespace {

constexpr std::size_t kMostScans = 8;  // Through the estimator, for speed.
constexpr std::size_t kMostBeams = 400;

slam::MapperOptions SmallEstimator() {
  slam::MapperOptions options;
  options.filter.kind = slam::FilterKind::kNone;
  return options;
}

// Reads the log once more into an estimator; returns how many scans it answered.
void EstimateLog(const std::filesystem::path& path) {
  std::size_t answered = 0, added = 0;
  const auto finite = [&answered](const Scan&, const slam::ScanOutcome& outcome) {
    ++answered;
    Must(outcome.T_map_robot.IsFinite() && std::isfinite(outcome.score), "an estimate is finite");
  };
  slam::ScanPipeline pipeline(SmallEstimator(), {}, slam::SerialFor,
                              {.used = finite, .dropped = [&answered](const Scan&, DropReason) { ++answered; }});
  static_cast<void>(ReadLog(path, {}, [&](LogRecord&& record) {
    if (auto* const odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry)) pipeline.Add(*odometry);
    } else if (Scan& scan = std::get<Scan>(record); ValidateScan(scan) && scan.ranges_m.size() <= kMostBeams) {
      pipeline.Add(std::make_shared<const Scan>(std::move(scan)));
      ++added;
    }
    return added < kMostScans;
  }));
  pipeline.Finish();
  Must(answered == added, "every scan is used or dropped");
}

bool RunLogFile(std::string_view bytes) {
  static const MemoryFile file;
  const std::filesystem::path path = file.With(bytes);
  int scans = 0, odometries = 0;
  const auto summary = ReadLog(path, {}, [&](LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      ++odometries;
      Must(odometry->T_odom_robot.IsFinite() && std::abs(odometry->T_odom_robot.theta) <= kPi, "odometry is a pose");
    } else {
      ++scans;
      const Scan& scan = std::get<Scan>(record);
      Must(!scan.ranges_m.empty() && scan.T_robot_laser.IsFinite(), "a scan has ranges and a place");
    }
    return true;
  });
  if (!summary) {
    Must(!summary.error().message.empty(), "a refusal has a reason");
    return false;
  }
  Must(summary->scans == scans && summary->odometries == odometries, "the summary counts every record");
  for (const LogComplaint& complaint : summary->complaints)
    Must(complaint.line > 0 && !complaint.reason.empty(), "a complaint names line and reason");
  EstimateLog(path);
  return scans + odometries > 0;
}

bool RunTrajectory(std::string_view bytes) {
  static const MemoryFile file;
  const auto read = ReadTum(file.With(bytes));
  if (!read) {
    Must(!read.error().message.empty(), "a refusal has a reason");
    return false;
  }
  for (std::size_t i = 0; i < read->size(); ++i) {
    const StampedPose& pose = (*read)[i];
    Must(pose.T_map_robot.IsFinite(), "a pose of a file is finite");
    Must(i == 0 || pose.stamp > (*read)[i - 1].stamp, "stamps grow");
    const auto found = PoseOn(*read, pose.stamp, 1.0);
    Must(found && found->IsFinite(), "a path has its own poses");
    if (i > 0) static_cast<void>(PoseOn(*read, pose.stamp - 1, 1e9));
  }
  return !read->empty();
}

bool RunCloud(std::string_view bytes) {
  const auto cloud = DecodeCloud(bytes);
  if (!cloud) {
    Must(!cloud.error().message.empty(), "a refusal has a reason");
    return false;
  }
  for (const CloudFormat format :
       {CloudFormat::kPly, CloudFormat::kPcd, CloudFormat::kPlyText, CloudFormat::kPcdText}) {
    const auto again = DecodeCloud(EncodeCloud(*cloud, format));
    Must(again && again->size() == cloud->size(), "a cloud that was read can be written and read again");
  }
  return true;
}

bool RunLog(std::string_view input) {
  Pieces pieces(input);
  switch (pieces.Take() % 3) {
    case 0:
      return RunLogFile(pieces.rest());
    case 1:
      return RunTrajectory(pieces.rest());
    default:
      return RunCloud(pieces.rest());
  }
}

std::vector<std::string> SeedsOfLogs() {
  const auto seed = [](char kind, const std::string& text) { return std::string(1, kind) + text; };
  const TempDirectory directory;
  Must(WriteTum({{100'000'000, {0.5, 1, 0.1}}, {200'000'000, {1, 1, 0.2}}, {1'300'000'000, {2, 1, 3}}},
                directory / "path.tum")
           .has_value(),
       "a trajectory can be written");
  std::vector<std::string> seeds = {
      seed(0,
           "# comment\nPARAM laser_type SICK 1.0 host 0.1\nODOM 1.5 -2.25 0.5 0.1 0.0 0 976052857.10 host 0.1\n"
           "FLASER 5 1.07 1.08 81.83 2.5 3 1.7 -2.25 0.5 1.5 -2.25 0.5 976052857.337530 host 0.3\n"
           "RLASER 3 1 2 3 1.3 -2.25 3.6 1.5 -2.25 0.5 976052857.437530 host 0.4\n"),
      seed(0,
           "ROBOTLASER1 0 -1.57 3.14 0.78 30 0.01 0 5 1 2 3 4 5 2 7 8 1 1 0 1 1 0 0.3 0.1 0 0 0 976058.0 host 1\n"
           "TILTLASER1 0.2 0 -1.57 3.14 0.78 30 0.01 0 5 1 2 3 4 5 0 1 1 0 1 1 0 0.3 0.1 0 0 0 976058.2 host 1\n"),
      seed(0, "ODOM 1 2 0.5 0 0 0 10.0 h 0\nRAWLASER1 0 -1.5 3.0 1.5 81.9 0.01 0 3 1 2 3 0 10.5 host 1\n"),
      seed(0, "Odometry 1 2 0.5 \nLaser 4 1 2 3 8.19 \nOdometry 1.1 2 0.5 \nLaser 4 1 2 3 4 \n"),
      seed(1, directory.Read("path.tum"))};
  const PointCloud cloud = {{1, 2, 3}, {-1.5F, 0.25F, 1e-3F}};
  for (const CloudFormat format : {CloudFormat::kPly, CloudFormat::kPcd, CloudFormat::kPlyText, CloudFormat::kPcdText})
    seeds.push_back(seed(2, EncodeCloud(cloud, format)));
  return seeds;
}

const bool kLogTarget = Register({"log", &RunLog, &SeedsOfLogs});

}  // namespace
}  // namespace cairn::fuzz
