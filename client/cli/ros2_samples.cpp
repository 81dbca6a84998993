#include "client/cli/ros2_samples.h"

#include <algorithm>

namespace cairn::client {
namespace {

// As the server's door has them where nothing else is configured.
constexpr const char* kOdomFrame = "odom";
constexpr std::array kBaseFrames = {"base_footprint", "base_link"};
constexpr const char* kOdometrySensor = "odometry";

}  // namespace

std::optional<ScanSample> Ros2Samples::Take(const std::string& sensor, ros2::LaserScan&& message,
                                            const ros2::Origin& origin) {
  Lidar& lidar = lidars_[sensor];
  if (message.header.frame != lidar.frame) {
    lidar.frame = message.header.frame;
    lidar.version = 0;
  }
  FindMounting(lidar);
  const std::uint64_t number = lidar.numbers.Next(origin);
  if (!lidar.mounting) return std::nullopt;
  ScanSample sample{{robot_id_, HashName(sensor), 0}, ros2::ScanOf(std::move(message), *lidar.mounting)};
  sample.scan.sequence = number;
  return sample;
}

void Ros2Samples::FindMounting(Lidar& lidar) const {
  const std::uint64_t version = own_.version() + shared_.version() + 1;
  if (lidar.version == version || base_frame_.empty()) return;
  lidar.version = version;
  lidar.mounting.reset();
  const auto motion = ros2::FindMotion(std::array<const ros2::FrameTree*, 2>{&own_, &shared_}, base_frame_, lidar.frame,
                                       std::array{odom_frame_, std::string("map")});
  if (!motion) return;
  if (const auto mounting = ros2::MountingOf(*motion)) lidar.mounting = *mounting;
}

std::optional<OdometrySample> Ros2Samples::Take(const ros2::Odometry& message, const ros2::Origin& origin) {
  const auto motion = ros2::MotionOf(message.pose);
  if (!motion) return std::nullopt;
  const std::string base = message.child_frame.empty() ? kBaseFrames.front() : message.child_frame;
  if (base != base_frame_) {
    base_frame_ = base;
    for (auto& [sensor, lidar] : lidars_) lidar.version = 0;
  }
  odom_frame_ = message.header.frame.empty() ? kOdomFrame : message.header.frame;
  OdometrySample sample{{robot_id_, HashName(kOdometrySensor), 0},
                        {odometry_numbers_.Next(origin), message.header.stamp, ros2::PlanarPart(*motion)}};
  return sample;
}

std::vector<OdometrySample> Ros2Samples::Take(const ros2::Transforms& message, const ros2::Origin& origin) {
  for (const ros2::Transform& transform : message.transforms) static_cast<void>(own_.Set(transform));
  return FromTransforms(message, true, origin);
}

std::vector<OdometrySample> Ros2Samples::TakeShared(const ros2::Transforms& message, bool only,
                                                    const ros2::Origin& origin) {
  return FromTransforms(message, only, origin);
}

std::vector<OdometrySample> Ros2Samples::FromTransforms(const ros2::Transforms& message, bool only,
                                                        const ros2::Origin& origin) {
  std::vector<OdometrySample> samples;
  if (has_odometry_topic_) return samples;
  for (const ros2::Transform& transform : message.transforms) {
    const bool prefixed = transform.header.frame == robot_ + "/" + kOdomFrame;
    if (!prefixed && (!only || transform.header.frame != kOdomFrame)) continue;
    const std::string prefix = prefixed ? robot_ + "/" : std::string();
    const bool is_base = std::any_of(kBaseFrames.begin(), kBaseFrames.end(),
                                     [&](const char* base) { return transform.child_frame == prefix + base; });
    if (!is_base) continue;
    if (auto sample = Take(ros2::Odometry{transform.header, transform.child_frame, transform.T_frame_child}, origin))
      samples.push_back(*std::move(sample));
  }
  return samples;
}

}  // namespace cairn::client
