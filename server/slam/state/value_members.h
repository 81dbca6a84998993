// How archives (archive.h) write and read values of classes that do not list their members: those of `common`, of the
// standard library and of Eigen.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <concepts>
#include <random>
#include <sstream>
#include <string>
#include <type_traits>

#include "common/geometry/pose2.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"

namespace cairn::slam {

template <typename T, typename Of>
concept MaybeConst = std::same_as<std::remove_const_t<T>, Of>;

// A pose must be finite and within the bounds of odometry.
template <typename Archive, MaybeConst<Pose2> Self>
void MembersOf(Archive& archive, Self& pose) {
  archive(pose.x, pose.y, pose.theta);
  if constexpr (Archive::kReads)
    archive.Require(pose.IsFinite() && std::abs(pose.x) <= 2e7 && std::abs(pose.y) <= 2e7, "a pose");
}
template <typename Archive, MaybeConst<Odometry> Self>
void MembersOf(Archive& archive, Self& odometry) {
  archive(odometry.sequence, odometry.stamp, odometry.T_odom_robot);
}
template <typename Archive, MaybeConst<Scan> Self>
void MembersOf(Archive& archive, Self& scan) {
  archive(scan.sequence, scan.stamp, scan.angle_first_rad, scan.angle_step_rad, scan.range_min_m, scan.range_max_m,
          scan.beam_period_s, scan.tilt_rad, scan.T_robot_laser, scan.ranges_m);
  if constexpr (Archive::kReads) archive.Require(ValidateScan(scan).has_value(), "a scan");
}
// The standard defines the text of a random engine.
template <typename Archive, MaybeConst<std::mt19937_64> Self>
void MembersOf(Archive& archive, Self& engine) {
  std::stringstream stream;
  std::string text;
  if constexpr (!Archive::kReads) {
    stream << engine;
    text = stream.str();
  }
  archive(text);
  if constexpr (Archive::kReads) {
    stream.str(text);
    stream >> engine;
    archive.Require(!stream.fail(), "a random engine");
  }
}
template <typename Archive, MaybeConst<Eigen::AlignedBox2d> Self>
void MembersOf(Archive& archive, Self& box) {
  archive(box.min(), box.max());
}

}  // namespace cairn::slam
