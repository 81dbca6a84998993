#include "client/cli/recording_file.h"

#include <algorithm>
#include <utility>

namespace cairn::client {
namespace {

std::string RobotTopic(const std::string& robot, const std::string& what) {
  return "/robots/" + robot + "/" + what;
}
std::string MapFrame(const std::string& site) {
  return site + "/map";
}
std::string OdometryFrame(const std::string& robot) {
  return robot + "/odom";
}
std::string BaseFrame(const std::string& robot) {
  return robot + "/base";
}

}  // namespace

Result<std::unique_ptr<RecordingFile>> RecordingFile::Create(const std::filesystem::path& path, bool overwrite) {
  auto writer = bag::McapWriter::Create(path, {.overwrite = overwrite});
  if (!writer) return tl::unexpected(writer.error());
  return std::unique_ptr<RecordingFile>(new RecordingFile(*std::move(writer)));
}

Result<void> RecordingFile::Write(const std::string& topic, const char* schema, const std::string& message,
                                  std::int64_t time) {
  auto channel = channels_.find(topic);
  if (channel == channels_.end()) {
    auto known = schemas_.find(schema);
    if (known == schemas_.end()) {
      const auto added = writer_->AddSchema(schema, bag::kProtobuf, bag::DescriptorsOf(schema));
      if (!added) return tl::unexpected(added.error());
      known = schemas_.emplace(schema, *added).first;
    }
    const auto added = writer_->AddChannel(known->second, topic, bag::kProtobuf);
    if (!added) {
      ++counts_.without_topic;
      return {};
    }
    channel = channels_.emplace(topic, *added).first;
  }
  if (chunk_began_ == 0) chunk_began_ = time;
  const auto time_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(time, 0));
  return writer_->Write(channel->second, time_ns, time_ns, message);
}

Result<void> RecordingFile::EndOldChunk(std::int64_t time) {
  if (chunk_began_ == 0 || time - chunk_began_ < kChunkAge) return {};
  chunk_began_ = 0;
  return writer_->EndChunk();
}

// The details come first: who reads the message knows them by then.
Result<void> RecordingFile::Add(const std::string& robot, const std::string& sensor, std::uint64_t session,
                                const Scan& scan, std::int64_t time) {
  const std::string topic = RobotTopic(robot, "scan/" + sensor);
  if (auto written =
          Write(topic + bag::kDetailsSuffix, bag::kScanDetailsSchema, bag::EncodeDetails(scan, session), time);
      !written)
    return written;
  ++counts_.scans;
  return Write(topic, bag::kLaserScanSchema, bag::EncodeLaserScan(scan, BaseFrame(robot)), time);
}

Result<void> RecordingFile::Add(const std::string& robot, std::uint64_t session, const Odometry& odometry,
                                std::int64_t time) {
  const std::string topic = RobotTopic(robot, "odometry");
  if (auto written =
          Write(topic + bag::kDetailsSuffix, bag::kOdometryDetailsSchema, bag::EncodeDetails(odometry, session), time);
      !written)
    return written;
  if (auto written = Write(
          RobotTopic(robot, "tf"), bag::kTransformSchema,
          bag::EncodeTransform(odometry.stamp, OdometryFrame(robot), BaseFrame(robot), odometry.T_odom_robot), time);
      !written)
    return written;
  ++counts_.odometry;
  return Write(topic, bag::kPoseSchema, bag::EncodePose(odometry.stamp, OdometryFrame(robot), odometry.T_odom_robot),
               time);
}

Result<void> RecordingFile::Add(const PoseReport& pose, std::int64_t time) {
  if (auto written = Write(
          RobotTopic(pose.robot, "tf"), bag::kTransformSchema,
          bag::EncodeTransform(pose.stamp, MapFrame(pose.site), OdometryFrame(pose.robot), pose.T_map_odom), time);
      !written)
    return written;
  ++counts_.poses;
  return Write(RobotTopic(pose.robot, "pose"), bag::kPoseSchema,
               bag::EncodePose(pose.stamp, MapFrame(pose.site), pose.T_map_robot), time);
}

Result<void> RecordingFile::Add(const std::string& site, const OccupancyImage& map, std::int64_t time) {
  ++counts_.maps;
  return Write("/sites/" + site + "/map", bag::kGridSchema, bag::EncodeGrid(time, MapFrame(site), map), time);
}

Result<void> RecordingFile::AddLog(bag::LogLevel level, const std::string& about, std::string message,
                                   std::int64_t time) {
  std::replace_if(
      message.begin(), message.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  ++counts_.log_lines;
  return Write("/log", bag::kLogSchema, bag::EncodeLog(time, level, about, message), time);
}

}  // namespace cairn::client
