// A recording: what robots send and what the server says of them, as messages of an MCAP file that Foxglove shows
// (bag/foxglove_encoding.h) and that is read as a log (bag/bag_reader.h).
//
// Topics: /robots/R/scan/SENSOR, /robots/R/odometry, /robots/R/pose, /robots/R/tf, /sites/S/map, /log. Frames: S/map,
// R/odom, R/base; poses of the server are the transforms S/map -> R/odom, odometry R/odom -> R/base. Scans are in
// R/base, with the mounting of the lidar as their pose. Beside scans and odometry stand their details, which make them
// exact. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "common/bag/foxglove_encoding.h"
#include "common/bag/mcap_writer.h"
#include "common/map/occupancy_image.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "common/service/pose_report.h"
#include "common/status.h"

namespace cairn::client {

class RecordingFile {
 public:
  struct Counts {
    std::uint64_t scans = 0, odometry = 0, poses = 0, maps = 0, log_lines = 0;
    std::uint64_t without_topic = 0;  // Messages left out because the file has as many topics as a file may have.
  };

  // kAlreadyExists: there is such a file, and it is not to be overwritten.
  [[nodiscard]] static Result<std::unique_ptr<RecordingFile>> Create(const std::filesystem::path& path, bool overwrite);

  // Each takes the time at which the value was received, in nanoseconds since 1970. REQUIRES: names are valid
  // (ValidateName). Errors are those of McapWriter::Write: the file cannot be written any more.
  [[nodiscard]] Result<void> Add(const std::string& robot, const std::string& sensor, std::uint64_t session,
                                 const Scan& scan, std::int64_t time);
  [[nodiscard]] Result<void> Add(const std::string& robot, std::uint64_t session, const Odometry& odometry,
                                 std::int64_t time);
  [[nodiscard]] Result<void> Add(const PoseReport& pose, std::int64_t time);
  [[nodiscard]] Result<void> Add(const std::string& site, const OccupancyImage& map, std::int64_t time);
  // `about`: a robot, a site or the recorder. Characters that are not printable ASCII are replaced.
  [[nodiscard]] Result<void> AddLog(bag::LogLevel level, const std::string& about, std::string message,
                                    std::int64_t time);

  // Ends the chunk whose first message is older than kChunkAge, so that little is lost with a recorder that is killed.
  static constexpr std::int64_t kChunkAge = 2'000'000'000;
  [[nodiscard]] Result<void> EndOldChunk(std::int64_t time);
  [[nodiscard]] Result<void> Finish() { return writer_->Finish(); }

  [[nodiscard]] const Counts& counts() const { return counts_; }
  [[nodiscard]] std::uint64_t bytes() const { return writer_->bytes(); }

 private:
  explicit RecordingFile(std::unique_ptr<bag::McapWriter> writer) : writer_(std::move(writer)) {}
  [[nodiscard]] Result<void> Write(const std::string& topic, const char* schema, const std::string& message,
                                   std::int64_t time);

  const std::unique_ptr<bag::McapWriter> writer_;
  std::map<std::string, std::uint16_t> schemas_;   // By name.
  std::map<std::string, std::uint16_t> channels_;  // By topic.
  std::int64_t chunk_began_ = 0;
  Counts counts_;
};

}  // namespace cairn::client
