#include "common/bag/bag_reader.h"

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/bag/bag_folder.h"
#include "common/bag/bag_messages.h"
#include "common/bag/bag_survey.h"
#include "common/bag/scan_order.h"

namespace cairn::bag {
namespace {

constexpr int kMostComplaints = 100;

// Turns messages into records.
class BagEmitter {
 public:
  BagEmitter(const BagSurvey& survey, const LogReaderOptions& options, const RecordingSink& sink)
      : survey_(survey),
        options_(options),
        sink_(sink),
        lidars_(survey.topics().lidars.size()),
        order_(lidars_.size(), [this](Scan&& scan, std::size_t lidar) {
          ++summary_.scans;
          return sink_(std::move(scan), lidar);
        }) {
    summary_.notes = survey.notes();
    summary_.lidars = survey.LidarNames();
    summary_.entry = "message";
  }

  // False if the sink wants no more, as below.
  bool TakeScan(std::size_t number, std::string_view bytes) {
    ++messages_;
    const Topic& topic = survey_.topics().lidars[number].scans;
    Lidar& lidar = lidars_[number];
    auto message = DecodeScan(topic, bytes);
    if (!message) return Complain(topic.name, message.error());
    Scan scan;
    if (lidar.details && lidar.details->stamp == message->scan.header.stamp) {
      if (options_.no_return_m > 0.0) SetNoReturn(message->scan);
      scan = *std::exchange(lidar.details, std::nullopt);
      scan.sequence = 0;
      scan.ranges_m = std::move(message->scan.ranges);
      if (options_.no_return_m > 0.0) scan.range_max_m = options_.no_return_m;
      if (options_.T_robot_laser) scan.T_robot_laser = *options_.T_robot_laser;
    } else {
      const auto& mounting = MountingOf(lidar, *message);
      if (!mounting) return Complain(topic.name, mounting.error());
      if (options_.no_return_m > 0.0) SetNoReturn(message->scan);
      scan = ros2::ScanOf(std::move(message->scan), *mounting);
    }
    if (options_.timing.scan_period_s == 0.0) scan.beam_period_s = 0.0;
    if (const auto timed = PutInOrderOfTime(options_.timing, scan); !timed) return Complain(topic.name, timed.error());
    return order_.Add(std::move(scan), number);
  }
  // The scans that wait for those of other lidars.
  bool Finish() { return order_.Finish(); }

  // What the next scan has no fields for, and the same for odometry.
  bool TakeScanDetails(std::size_t lidar, std::string_view bytes) {
    ++messages_;
    auto details = DecodeScanDetails(bytes);
    if (!details) return Complain(survey_.topics().lidars[lidar].details->name, details.error());
    lidars_[lidar].details = *std::move(details);
    return true;
  }
  bool TakeOdometryDetails(std::string_view bytes) {
    ++messages_;
    const auto details = DecodeOdometryDetails(bytes);
    if (!details) return Complain(survey_.topics().odometry_details->name, details.error());
    odometry_details_ = *details;
    return true;
  }

  bool TakeOdometry(std::string_view bytes) {
    ++messages_;
    const auto message = DecodeOdometry(*survey_.topics().odometry, bytes);
    if (!message) return Complain(survey_.topics().odometry->name, message.error());
    if (!odometry_details_ || odometry_details_->stamp != message->header.stamp)
      return EmitOdometry(message->header.stamp, message->pose);
    const Odometry exact = *std::exchange(odometry_details_, std::nullopt);
    ++summary_.odometries;
    return sink_(Odometry{0, exact.stamp, exact.T_odom_robot}, 0);
  }

  bool TakeTransforms(const Topic& topic, std::string_view bytes) {
    ++messages_;
    const auto message = DecodeTransforms(topic, bytes);
    if (!message) return Complain("transforms", message.error());
    for (const ros2::Transform& transform : message->transforms) {
      if (transform.header.frame != survey_.odometry_frame() || transform.child_frame != survey_.base_frame()) continue;
      if (!EmitOdometry(transform.header.stamp, transform.T_frame_child)) return false;
    }
    return true;
  }

  [[nodiscard]] LogSummary summary() && { return std::move(summary_); }

 private:
  struct Lidar {
    std::string frame;         // Of the scan before.
    ros2::Pose3 T_frame_scan;  // The same.
    std::optional<Result<ros2::Mounting>> mounting;
    std::optional<Scan> details;
  };

  bool EmitOdometry(Stamp stamp, const ros2::Pose3& pose) {
    const auto motion = ros2::MotionOf(pose);
    if (!motion) return Complain("odometry", motion.error());
    if (last_stamp_ == stamp) return true;
    last_stamp_ = stamp;
    ++summary_.odometries;
    return sink_(Odometry{0, stamp, ros2::PlanarPart(*motion)}, 0);
  }

  const Result<ros2::Mounting>& MountingOf(Lidar& lidar, const ScanMessage& message) {
    const ros2::Pose3& T = message.T_frame_scan;
    const bool moved =
        T.translation != lidar.T_frame_scan.translation || T.rotation.coeffs() != lidar.T_frame_scan.rotation.coeffs();
    if (!lidar.mounting || message.scan.header.frame != lidar.frame || moved) {
      lidar.frame = message.scan.header.frame;
      lidar.T_frame_scan = T;
      lidar.mounting = survey_.MountingOf(lidar.frame, T, options_.T_robot_laser);
    }
    return *lidar.mounting;
  }

  // What is at or beyond the limit has hit nothing, whatever the message's own limit is.
  void SetNoReturn(ros2::LaserScan& message) const {
    message.range_max = options_.no_return_m;
    for (float& range : message.ranges)
      if (range >= options_.no_return_m) range = std::numeric_limits<float>::infinity();
  }

  bool Complain(const std::string& about, const Status& why) {
    if (++summary_.complaint_count <= kMostComplaints)
      summary_.complaints.push_back({messages_, about + ": " + why.message});
    return true;
  }

  const BagSurvey& survey_;
  const LogReaderOptions& options_;
  const RecordingSink& sink_;
  LogSummary summary_;
  int messages_ = 0;
  std::vector<Lidar> lidars_;
  ScanOrder order_;
  std::optional<Odometry> odometry_details_;
  std::optional<Stamp> last_stamp_;
};

}  // namespace

Result<LogSummary> ReadBag(const std::filesystem::path& path, const LogReaderOptions& options,
                           const RecordingSink& sink) {
  const auto names = FilesOf(path);
  if (!names) return tl::unexpected(names.error());
  Files files;
  for (const std::filesystem::path& name : *names) {
    auto file = OpenFile(name);
    if (!file) return tl::unexpected(file.error());
    if (names->size() > 1) (*file)->LetGo();
    files.push_back(*std::move(file));
  }
  const auto survey = BagSurvey::Of(files, options);
  if (!survey) return Fail(survey.error().code, path.string() + ": " + survey.error().message);
  const TopicChoice& topics = survey->topics();
  BagEmitter emitter(*survey, options, sink);
  std::vector<Topic> wanted;
  std::vector<std::function<bool(std::string_view)>> takers;  // Of each.
  const auto want = [&](const Topic& topic, std::function<bool(std::string_view)> take) {
    wanted.push_back(topic);
    takers.push_back(std::move(take));
  };
  for (std::size_t lidar = 0; lidar < topics.lidars.size(); ++lidar) {
    const ScanTopic& topic = topics.lidars[lidar];
    want(topic.scans, [&emitter, lidar](std::string_view bytes) { return emitter.TakeScan(lidar, bytes); });
    if (topic.details)
      want(*topic.details, [&emitter, lidar](std::string_view bytes) { return emitter.TakeScanDetails(lidar, bytes); });
  }
  if (topics.odometry) want(*topics.odometry, [&](std::string_view bytes) { return emitter.TakeOdometry(bytes); });
  if (topics.odometry_details)
    want(*topics.odometry_details, [&](std::string_view bytes) { return emitter.TakeOdometryDetails(bytes); });
  if (!topics.odometry)
    for (const Topic& topic : topics.moving)
      want(topic, [&](std::string_view bytes) { return emitter.TakeTransforms(topic, bytes); });
  bool goes_on = true;
  auto read = ReadMessages(files, wanted,
                           [&](std::size_t topic, std::string_view bytes) { return goes_on = takers[topic](bytes); });
  if (!read) return tl::unexpected(read.error());
  if (goes_on) emitter.Finish();
  return std::move(emitter).summary();
}

}  // namespace cairn::bag
