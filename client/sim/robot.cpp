#include "client/sim/robot.h"

#include <algorithm>
#include <utility>

#include "client/sim/arc.h"

namespace cairn::sim {
namespace {

constexpr double kMaxStep_s = 0.01;

}  // namespace

Robot::Robot(const Pose2& T_map_robot_start, RouteFollower follower, const WheelOptions& wheels, Random random)
    : follower_(std::move(follower)), wheels_(wheels), random_(random), T_map_robot_(T_map_robot_start) {}

void Robot::Drive(double seconds, std::vector<DriveLeg>* legs) {
  while (seconds - seconds_ > 1e-9) {
    const double step = std::min(kMaxStep_s, seconds - seconds_);
    twist_ = halt_ ? follower_.Brake(step) : follower_.Steer(T_map_robot_, step);
    if (legs != nullptr) legs->push_back({seconds_, T_map_robot_, twist_});
    const double way = twist_.speed_m_s * step, turn = twist_.turn_rad_s * step;
    T_map_robot_ = T_map_robot_ * DriveArc(way, turn);
    wheels_.Drive(way, turn, random_);
    seconds_ += step;
  }
}

Pose2 Robot::PoseAt(double seconds) const {
  const double ahead = std::max(0.0, seconds - seconds_);
  return T_map_robot_ * DriveArc(twist_.speed_m_s * ahead, twist_.turn_rad_s * ahead);
}

}  // namespace cairn::sim
