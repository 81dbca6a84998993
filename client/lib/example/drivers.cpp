// In place of a real robot's drivers: one that drives a quarter of a circle in an empty room, with ten scans a second.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <thread>

#include "client/lib/robot_client.h"

using namespace cairn;

namespace {

constexpr int kScans = 60;
constexpr int kBeams = 360;
constexpr double kPeriodS = 0.1;
constexpr double kSpeedMps = 0.4;
constexpr double kTurnRadps = 0.25;

// From a place in the room to its walls, which are 4 m and 3 m from where the robot begins.
double RangeToWall(const Pose2& T_room_robot, double angle_rad) {
  const double dx = std::cos(T_room_robot.theta + angle_rad);
  const double dy = std::sin(T_room_robot.theta + angle_rad);
  return std::min((std::copysign(4.0, dx) - T_room_robot.x) / dx, (std::copysign(3.0, dy) - T_room_robot.y) / dy);
}

}  // namespace

// Waits for the next scan. False: it was the last.
bool NextScan(Scan* scan, Odometry* odometry) {
  static const auto begin = std::chrono::system_clock::now();
  static int number = 0;
  if (number == kScans) return false;
  const double time_s = kPeriodS * number++;
  const auto now = begin + std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(time_s));
  std::this_thread::sleep_until(now);

  const double turned_rad = kTurnRadps * time_s;
  const double radius_m = kSpeedMps / kTurnRadps;
  odometry->stamp = now.time_since_epoch().count();
  odometry->T_odom_robot = {radius_m * std::sin(turned_rad), radius_m * (1.0 - std::cos(turned_rad)), turned_rad};
  scan->stamp = odometry->stamp;
  scan->angle_first_rad = -std::numbers::pi;
  scan->angle_step_rad = 2.0 * std::numbers::pi / kBeams;
  scan->range_min_m = 0.1;
  scan->range_max_m = 20.0;
  scan->ranges_m.clear();
  for (int beam = 0; beam < kBeams; ++beam) {
    const double angle_rad = scan->angle_first_rad + scan->angle_step_rad * beam;
    scan->ranges_m.push_back(static_cast<float>(RangeToWall(odometry->T_odom_robot, angle_rad)));
  }
  return true;
}
