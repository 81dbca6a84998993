#include "common/bag/bag_reader.h"

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/bag/bag_folder.h"
#include "common/bag/bag_survey.h"
#include "common/ros2/cdr_decoding.h"

namespace cairn::bag {
namespace {

constexpr int kMostComplaints = 100;

// Turns messages into records.
class BagEmitter {
 public:
  BagEmitter(const BagSurvey& survey, const LogReaderOptions& options, const std::function<bool(LogRecord&&)>& sink)
      : survey_(survey), options_(options), sink_(sink) {
    summary_.notes = survey.notes();
    summary_.entry = "message";
  }

  // False if the sink wants no more, as below.
  bool TakeScan(std::string_view bytes) {
    ++messages_;
    auto message = ros2::DecodeLaserScan(bytes);
    if (!message) return Complain(survey_.topics().scans.name, message.error());
    if (!mounting_ || message->header.frame != frame_) {
      frame_ = message->header.frame;
      mounting_ = survey_.MountingOf(frame_, options_.T_robot_laser);
    }
    if (!*mounting_) return Complain(survey_.topics().scans.name, mounting_->error());
    if (options_.no_return_m > 0.0) SetNoReturn(*message);
    Scan scan = ros2::ScanOf(*std::move(message), **mounting_);
    if (options_.timing.scan_period_s == 0.0) scan.beam_period_s = 0.0;
    if (const auto timed = PutInOrderOfTime(options_.timing, scan); !timed)
      return Complain(survey_.topics().scans.name, timed.error());
    ++summary_.scans;
    return sink_(std::move(scan));
  }

  bool TakeOdometry(std::string_view bytes) {
    ++messages_;
    const auto message = ros2::DecodeOdometry(bytes);
    if (!message) return Complain(survey_.topics().odometry->name, message.error());
    return EmitOdometry(message->header.stamp, message->pose);
  }

  bool TakeTransforms(std::string_view bytes) {
    ++messages_;
    const auto message = ros2::DecodeTransforms(bytes);
    if (!message) return Complain("transforms", message.error());
    for (const ros2::Transform& transform : message->transforms) {
      if (transform.header.frame != survey_.odometry_frame() || transform.child_frame != survey_.base_frame()) continue;
      if (!EmitOdometry(transform.header.stamp, transform.T_frame_child)) return false;
    }
    return true;
  }

  [[nodiscard]] LogSummary summary() && { return std::move(summary_); }

 private:
  bool EmitOdometry(Stamp stamp, const ros2::Pose3& pose) {
    const auto motion = ros2::MotionOf(pose);
    if (!motion) return Complain("odometry", motion.error());
    if (last_stamp_ == stamp) return true;
    last_stamp_ = stamp;
    ++summary_.odometries;
    return sink_(Odometry{0, stamp, ros2::PlanarPart(*motion)});
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
  const std::function<bool(LogRecord&&)>& sink_;
  LogSummary summary_;
  int messages_ = 0;
  std::string frame_;  // Of the scan before.
  std::optional<Result<ros2::Mounting>> mounting_;
  std::optional<Stamp> last_stamp_;
};

}  // namespace

Result<LogSummary> ReadBag(const std::filesystem::path& path, const LogReaderOptions& options,
                           const std::function<bool(LogRecord&&)>& sink) {
  const auto names = FilesOf(path);
  if (!names) return tl::unexpected(names.error());
  Files files;
  for (const std::filesystem::path& name : *names) {
    auto file = OpenFile(name);
    if (!file) return tl::unexpected(file.error());
    files.push_back(*std::move(file));
  }
  const auto survey = BagSurvey::Of(files, options);
  if (!survey) return Fail(survey.error().code, path.string() + ": " + survey.error().message);
  const TopicChoice& topics = survey->topics();
  std::vector<Topic> wanted = {topics.scans};
  if (topics.odometry) {
    wanted.push_back(*topics.odometry);
  } else {
    wanted.insert(wanted.end(), topics.moving.begin(), topics.moving.end());
  }
  BagEmitter emitter(*survey, options, sink);
  auto read = ReadMessages(files, wanted, [&](std::size_t topic, std::string_view bytes) {
    if (topic == 0) return emitter.TakeScan(bytes);
    return topics.odometry ? emitter.TakeOdometry(bytes) : emitter.TakeTransforms(bytes);
  });
  if (!read) return tl::unexpected(read.error());
  return std::move(emitter).summary();
}

}  // namespace cairn::bag
