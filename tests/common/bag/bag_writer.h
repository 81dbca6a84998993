// Bags as ROS 2 records them, made by tests: messages as CDR, and files of both storages. Written from the
// specifications, not with the code under test.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/ros2/messages.h"

namespace cairn::recorded {

inline constexpr const char* kScanType = "sensor_msgs/msg/LaserScan";
inline constexpr const char* kOdometryType = "nav_msgs/msg/Odometry";
inline constexpr const char* kTransformType = "tf2_msgs/msg/TFMessage";

template <typename Number>
std::string Raw(Number number) {
  std::string bytes(sizeof(number), '\0');
  std::memcpy(bytes.data(), &number, sizeof(number));
  return bytes;
}

// Little-endian CDR.
class CdrText {
 public:
  template <typename Number>
  CdrText& Add(Number number) {
    while ((bytes_.size() - 4) % sizeof(number) != 0) bytes_.push_back('\0');
    bytes_ += Raw(number);
    return *this;
  }
  CdrText& Add(const std::string& text) {
    Add(static_cast<std::uint32_t>(text.size() + 1));
    bytes_ += text + '\0';
    return *this;
  }
  CdrText& Add(const ros2::Header& header) {
    Add(static_cast<std::int32_t>(header.stamp / kNanosPerSecond));
    Add(static_cast<std::uint32_t>(header.stamp % kNanosPerSecond));
    return Add(header.frame);
  }
  CdrText& Add(const ros2::Pose3& pose) {
    for (int i = 0; i < 3; ++i) Add(pose.translation[i]);
    for (int i = 0; i < 4; ++i) Add(pose.rotation.coeffs()[i]);  // x, y, z, w
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_ = std::string("\0\1\0\0", 4);
};

inline std::string CdrOf(const ros2::LaserScan& scan) {
  CdrText cdr;
  cdr.Add(scan.header);
  const double angle_max = scan.angle_min + scan.angle_increment * (static_cast<double>(scan.ranges.size()) - 1.0);
  for (const double number : {scan.angle_min, angle_max, scan.angle_increment, scan.time_increment, scan.scan_time,
                              scan.range_min, scan.range_max})
    cdr.Add(static_cast<float>(number));
  cdr.Add(static_cast<std::uint32_t>(scan.ranges.size()));
  for (const float range : scan.ranges) cdr.Add(range);
  cdr.Add(std::uint32_t{0});  // No intensities.
  return cdr.bytes();
}

inline std::string CdrOf(const ros2::Odometry& odometry) {
  CdrText cdr;
  cdr.Add(odometry.header).Add(odometry.child_frame).Add(odometry.pose);
  for (int i = 0; i < 36 + 6 + 36; ++i) cdr.Add(0.0);  // Covariance, twist and its covariance.
  return cdr.bytes();
}

inline std::string CdrOf(const ros2::Transforms& message) {
  CdrText cdr;
  cdr.Add(static_cast<std::uint32_t>(message.transforms.size()));
  for (const ros2::Transform& one : message.transforms) cdr.Add(one.header).Add(one.child_frame).Add(one.T_frame_child);
  return cdr.bytes();
}

inline ros2::Transform Link(const std::string& parent, const std::string& child, const Pose2& T_parent_child,
                            Stamp stamp = 0) {
  return {{stamp, parent},
          child,
          {{T_parent_child.x, T_parent_child.y, 0.2},
           Eigen::Quaterniond(Eigen::AngleAxisd(T_parent_child.theta, Eigen::Vector3d::UnitZ()))}};
}

struct BagMessage {
  std::string topic;
  std::string type;
  std::uint64_t time = 0;
  std::string bytes;
};

inline std::string PackZstd(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1));
  return packed;
}

inline std::string PackLz4(const std::string& bytes) {
  std::string packed(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
  packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
  return packed;
}

inline std::string McapText(const std::string& text) {
  return Raw(static_cast<std::uint32_t>(text.size())) + text;
}
inline std::string McapRecordOf(char op, const std::string& content) {
  return op + Raw(static_cast<std::uint64_t>(content.size())) + content;
}
inline std::string McapMessageOf(std::uint16_t channel, std::uint64_t time, const std::string& bytes) {
  return McapRecordOf(5, Raw(channel) + Raw(std::uint32_t{0}) + Raw(time) + Raw(time) + bytes);
}
inline std::string McapSchemaOf(std::uint16_t id, const std::string& type) {
  return McapRecordOf(3, Raw(id) + McapText(type) + McapText("ros2msg") + McapText("# the fields"));
}
inline std::string McapChannelOf(std::uint16_t id, std::uint16_t schema, const std::string& topic) {
  return McapRecordOf(4, Raw(id) + Raw(schema) + McapText(topic) + McapText("cdr") + McapText(""));
}
inline std::string McapChunkOf(const std::string& records, const std::string& compression, bool checksum = true) {
  const std::string packed = compression == "zstd"  ? PackZstd(records)
                             : compression == "lz4" ? PackLz4(records)
                                                    : records;
  const auto crc = static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(records.data()), static_cast<uInt>(records.size())));
  return McapRecordOf(6, Raw(std::uint64_t{0}) + Raw(std::uint64_t{0}) +
                             Raw(static_cast<std::uint64_t>(records.size())) + Raw(checksum ? crc : 0U) +
                             McapText(compression) + Raw(static_cast<std::uint64_t>(packed.size())) + packed);
}
inline const std::string kMcapStart = "\x89MCAP0\r\n" + McapRecordOf(1, McapText("ros2") + McapText("tests"));
inline const std::string kMcapEnd =
    McapRecordOf(15, Raw(std::uint32_t{0})) + McapRecordOf(2, std::string(20, '\0')) + "\x89MCAP0\r\n";

// `per_chunk` 0: no chunks. Schemas and channels come with the first message that needs them.
inline std::string McapOf(const std::vector<BagMessage>& messages, const std::string& compression,
                          std::size_t per_chunk) {
  std::string file = kMcapStart, records;
  std::map<std::string, std::uint16_t> channels;
  std::size_t in_chunk = 0;
  for (const BagMessage& message : messages) {
    const auto [channel, is_new] = channels.try_emplace(message.topic, static_cast<std::uint16_t>(channels.size() + 1));
    if (is_new) {
      records += McapSchemaOf(channel->second, message.type);
      records += McapChannelOf(channel->second, channel->second, message.topic);
    }
    records += McapMessageOf(channel->second, message.time, message.bytes);
    if (per_chunk == 0 || ++in_chunk < per_chunk) continue;
    file += McapChunkOf(records, compression);
    records.clear();
    in_chunk = 0;
  }
  if (!records.empty()) file += per_chunk == 0 ? records : McapChunkOf(records, compression);
  return file + kMcapEnd;
}

inline void WriteSqlite(const std::filesystem::path& path, const std::vector<BagMessage>& messages) {
  SQLite::Database database(path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC);");
  SQLite::Transaction transaction(database);
  std::map<std::string, int> topics;
  SQLite::Statement add_topic(database, "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')");
  SQLite::Statement add(database, "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)");
  for (const BagMessage& message : messages) {
    const auto [topic, is_new] = topics.try_emplace(message.topic, static_cast<int>(topics.size()) + 7);
    if (is_new) {
      add_topic.reset();
      add_topic.bind(1, topic->second);
      add_topic.bind(2, message.topic);
      add_topic.bind(3, message.type);
      add_topic.exec();
    }
    add.reset();
    add.bind(1, topic->second);
    add.bind(2, static_cast<std::int64_t>(message.time));
    add.bind(3, message.bytes.data(), static_cast<int>(message.bytes.size()));
    add.exec();
  }
  transaction.commit();
}

inline std::string MetadataOf(const std::vector<std::string>& files) {
  std::string text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: any\n  relative_file_paths:\n";
  for (const std::string& file : files) text += "    - " + file + "\n";
  return text + "  compression_format: \"\"\n  compression_mode: \"\"\n";
}

}  // namespace cairn::recorded
