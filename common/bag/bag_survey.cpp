#include "common/bag/bag_survey.h"

#include <algorithm>
#include <array>
#include <tuple>

#include "common/bag/bag_messages.h"
#include "common/bag/foxglove_encoding.h"
#include "common/bag/unpack.h"

namespace cairn::bag {
namespace {

constexpr std::size_t kMaxMessageBytes = std::size_t{4} << 20;  // Unpacked: far longer than any scan.
constexpr const char* kUsualBaseFrame = "base_link";            // Where odometry names no frame.

// "odom", also with the name of a robot before it ("r1/odom").
bool IsOdometryFrame(std::string_view frame) {
  return frame == "odom" || frame.ends_with("/odom");
}

std::vector<Topic> TopicsOf(const Files& files) {
  std::vector<Topic> all;
  for (const auto& file : files)
    for (const Topic& topic : file->topics())
      if (std::find(all.begin(), all.end(), topic) == all.end()) all.push_back(topic);
  return all;
}

}  // namespace

Result<void> ReadMessages(const Files& files, const std::vector<Topic>& topics, const File::Sink& sink) {
  bool goes_on = true;
  for (const auto& file : files) {
    std::vector<std::size_t> wanted, meant;  // Topics of the file, and which of `topics` they are.
    for (std::size_t i = 0; i < file->topics().size(); ++i) {
      const auto found = std::find(topics.begin(), topics.end(), file->topics()[i]);
      if (found == topics.end()) continue;
      wanted.push_back(i);
      meant.push_back(static_cast<std::size_t>(found - topics.begin()));
    }
    if (wanted.empty()) continue;
    auto read = file->Read(wanted, [&](std::size_t topic, std::string_view message) {
      const auto which = std::find(wanted.begin(), wanted.end(), topic) - wanted.begin();
      const std::size_t index = meant[static_cast<std::size_t>(which)];
      if (!IsZstd(message)) return goes_on = sink(index, message);
      const auto unpacked = UnpackZstd(message, kMaxMessageBytes);
      return goes_on = sink(index, unpacked ? std::string_view(*unpacked) : std::string_view());
    });
    if (files.size() > 1) file->LetGo();
    if (!read || !goes_on) return read;
  }
  return {};
}

Result<BagSurvey> BagSurvey::Of(const Files& files, const LogReaderOptions& options) {
  BagSurvey survey;
  for (const auto& file : files) survey.notes_.insert(survey.notes_.end(), file->notes().begin(), file->notes().end());
  auto topics = ChooseTopics(TopicsOf(files), options.scan_topic, options.odometry_topic, options.all_lidars);
  if (!topics) return tl::unexpected(topics.error());
  survey.topics_ = *std::move(topics);
  if (auto read = survey.ReadFixed(files); !read) return tl::unexpected(read.error());
  if (auto read = survey.ReadFirstFrames(files); !read) return tl::unexpected(read.error());
  if (auto found = survey.FindBaseFrame(files); !found) return tl::unexpected(found.error());
  const auto mounted = [&] {
    return std::all_of(survey.first_scans_.begin(), survey.first_scans_.end(), [&](const FirstScan& scan) {
      return scan.frame && survey.MountingOf(*scan.frame, scan.T_frame_scan, std::nullopt).has_value();
    });
  };
  if (!survey.topics_.odometry) {
    if (auto read = survey.ReadMoving(files, [] { return false; }); !read) return tl::unexpected(read.error());
    if (auto found = survey.FindOdometryTransform(); !found) return tl::unexpected(found.error());
  } else if (!mounted()) {
    if (auto read = survey.ReadMoving(files, mounted); !read) return tl::unexpected(read.error());
  }
  if (auto checked = survey.CheckLidars(options); !checked) return tl::unexpected(checked.error());
  for (std::size_t lidar = 0; lidar < survey.first_scans_.size(); ++lidar) {
    const FirstScan& scan = survey.first_scans_[lidar];
    if (!scan.frame) continue;
    const auto mounting = survey.MountingOf(*scan.frame, scan.T_frame_scan, options.T_robot_laser);
    if (!mounting) return tl::unexpected(mounting.error());
    const Pose2& T = mounting->T_robot_laser;
    survey.notes_.push_back(survey.LidarNames()[lidar] + ": frame '" + *scan.frame + "' is mounted on '" +
                            survey.base_frame_ + "' at " + std::to_string(T.x) + ", " + std::to_string(T.y) + ", " +
                            std::to_string(T.theta) + (mounting->upside_down ? ", upside down" : ""));
  }
  survey.notes_.push_back("odometry: " + (survey.topics_.odometry ? survey.topics_.odometry->name
                                                                  : "transforms from '" + survey.odometry_frame_ +
                                                                        "' to '" + survey.base_frame_ + "'"));
  return survey;
}

std::vector<std::string> BagSurvey::LidarNames() const {
  std::vector<std::string> names;
  for (const ScanTopic& lidar : topics_.lidars) names.push_back(lidar.scans.name);
  return names;
}

Result<void> BagSurvey::CheckLidars(const LogReaderOptions& options) const {
  if (first_scans_.size() < 2) return {};
  const std::vector<std::string> names = LidarNames();
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  const std::string choose = "; --scan-topic chooses one or, with commas, some of " + list;
  if (options.T_robot_laser)
    return Fail(StatusCode::kInvalidArgument, "--laser-at says where one lidar is, and there are several" + choose);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const FirstScan& scan = first_scans_[i];
    if (!scan.frame) continue;
    const auto mounting = MountingOf(*scan.frame, scan.T_frame_scan, std::nullopt);
    if (!mounting) return Fail(mounting.error().code, names[i] + ": " + mounting.error().message + choose);
    // A program that filters scans publishes those of the same lidar once more.
    for (std::size_t k = 0; k < i; ++k)
      if (first_scans_[k].frame == scan.frame && !topics_.lidars[i].details)
        return Fail(StatusCode::kInvalidArgument,
                    names[k] + " and " + names[i] + " are of one lidar: their frame is '" + *scan.frame + "'" + choose);
  }
  return {};
}

Result<void> BagSurvey::ReadFixed(const Files& files) {
  return ReadMessages(files, topics_.fixed, [&](std::size_t topic, std::string_view bytes) {
    if (const auto message = DecodeTransforms(topics_.fixed[topic], bytes))
      for (const ros2::Transform& transform : message->transforms) static_cast<void>(fixed_.Set(transform));
    return true;
  });
}

Result<void> BagSurvey::ReadFirstFrames(const Files& files) {
  const std::size_t lidars = topics_.lidars.size();
  first_scans_.resize(lidars);
  std::vector<Topic> wanted;
  for (const ScanTopic& lidar : topics_.lidars) wanted.push_back(lidar.scans);
  if (topics_.odometry) wanted.push_back(*topics_.odometry);
  bool odometry_seen = !topics_.odometry;
  auto read = ReadMessages(files, wanted, [&](std::size_t topic, std::string_view bytes) {
    if (topic < lidars && !first_scans_[topic].frame) {
      if (const auto message = DecodeScan(wanted[topic], bytes))
        first_scans_[topic] = {message->scan.header.frame, message->T_frame_scan};
    } else if (topic == lidars && !odometry_seen) {
      if (const auto odometry = DecodeOdometry(*topics_.odometry, bytes)) {
        odometry_seen = true;
        odometry_frame_ = odometry->header.frame;
        base_frame_ = odometry->child_frame;
      }
    }
    return !odometry_seen || !std::all_of(first_scans_.begin(), first_scans_.end(),
                                          [](const FirstScan& scan) { return scan.frame.has_value(); });
  });
  return read;
}

Result<void> BagSurvey::FindBaseFrame(const Files& files) {
  if (!base_frame_.empty()) return {};
  if (topics_.odometry && topics_.odometry->type == kPoseSchema) {
    const auto found = [&] {
      for (const auto& [parent, child] : odometry_links_)
        if (parent == odometry_frame_) base_frame_ = child;
      return !base_frame_.empty();
    };
    if (auto read = ReadMoving(files, found); !read) return read;
    // Without transforms, scans are taken to be in the frame of the robot: their pose says the mounting.
    if (base_frame_.empty() && first_scans_.front().frame) base_frame_ = *first_scans_.front().frame;
  }
  if (base_frame_.empty()) base_frame_ = kUsualBaseFrame;
  return {};
}

Result<void> BagSurvey::ReadMoving(const Files& files, const std::function<bool()>& enough) {
  return ReadMessages(files, topics_.moving, [&](std::size_t topic, std::string_view bytes) {
    const auto message = DecodeTransforms(topics_.moving[topic], bytes);
    if (!message) return true;
    const std::uint64_t before = moving_.version();
    for (const ros2::Transform& transform : message->transforms) {
      if (IsOdometryFrame(transform.header.frame) && odometry_links_.size() < ros2::FrameTree::kMaxFrames)
        odometry_links_.emplace(transform.header.frame, transform.child_frame);
      static_cast<void>(moving_.Set(transform));
    }
    return moving_.version() == before || !enough();
  });
}

Result<void> BagSurvey::FindOdometryTransform() {
  if (odometry_links_.empty())
    return Fail(StatusCode::kNotFound, "no topic of odometry, and no transform from a frame 'odom'");
  if (odometry_links_.size() > 1) {
    std::string links;
    for (const auto& [parent, child] : odometry_links_) links += " '" + parent + "' to '" + child + "'";
    return Fail(StatusCode::kInvalidArgument, "more than one transform from a frame 'odom':" + links.substr(0, 1000));
  }
  std::tie(odometry_frame_, base_frame_) = *odometry_links_.begin();
  return {};
}

Result<ros2::Mounting> BagSurvey::MountingOf(const std::string& laser_frame, const ros2::Pose3& T_frame_scan,
                                             const std::optional<Pose2>& T_robot_laser) const {
  const auto T_frame = ros2::MotionOf(T_frame_scan);
  if (!T_frame) return tl::unexpected(T_frame.error());
  const auto motion = ros2::FindMotion(std::array<const ros2::FrameTree*, 2>{&fixed_, &moving_}, base_frame_,
                                       laser_frame, std::array{odometry_frame_, std::string("map")});
  Result<ros2::Mounting> mounting =
      Fail(StatusCode::kFailedPrecondition, "no transform connects the lidar's frame '" + laser_frame +
                                                "' with the robot's frame '" + base_frame_ +
                                                "'; --laser-at X,Y,THETA says where the lidar is mounted");
  if (motion) mounting = ros2::MountingOf(*motion * *T_frame);
  if (!mounting && T_robot_laser) return ros2::Mounting{*T_robot_laser};
  if (mounting && T_robot_laser) mounting->T_robot_laser = *T_robot_laser;
  return mounting;
}

}  // namespace cairn::bag
