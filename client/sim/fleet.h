// A fleet of simulated robots in one world, as one endless stream of log records in the order of their stamps, with
// the true poses beside it. Same world, options and seed: same records, bit for bit. Robots' scans are staggered over
// the scan period, and each scan has an odometry sample before and after it.
// A scanner on a tilting mount nods as `tilt` says, and the robot halts meanwhile.
// The stream does not wait for real time: it advances as fast as the caller asks. Use it from one thread at a time.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/furniture.h"
#include "client/sim/laser.h"
#include "client/sim/robot.h"
#include "client/sim/route_follower.h"
#include "client/sim/scene.h"
#include "client/sim/tilt_mount.h"
#include "client/sim/wheels.h"
#include "client/sim/world.h"
#include "common/sensor/log_record.h"
#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn::sim {

struct FleetOptions {
  int robots = 3;  // 1..1000; spread over the world's routes, and along them where there are more.
  double scan_hz = 10.0;
  double odometry_hz = 50.0;  // 0: robots that send none.
  LaserOptions laser;
  TiltOptions tilt;
  WheelOptions wheels;  // Means over all robots; each robot differs from them by wheel_spread.
  WheelSpread wheel_spread;
  DriveOptions drive;
  bool see_each_other = true;  // Robots appear in each other's scans as discs.
  double robot_radius_m = 0.22;
  double robot_height_m = 0.5;
  FurnitureOptions furniture;  // Beside what the world has.
  Stamp first_stamp = 1'700'000'000'000'000'000;
  std::uint64_t seed = 1;
};
[[nodiscard]] Result<void> Validate(const FleetOptions& options);

struct FleetRecord {
  int robot = 0;
  LogRecord record;
};

class Fleet {
 public:
  // Fails if the options are out of range or the world has no route.
  [[nodiscard]] static Result<Fleet> Create(Surroundings surroundings, const FleetOptions& options);
  [[nodiscard]] static Result<Fleet> Create(World world, const FleetOptions& options) {
    return Create(SurroundingsOf(std::move(world)), options);
  }

  [[nodiscard]] int robots() const { return static_cast<int>(robots_.size()); }
  [[nodiscard]] const std::string& name(int robot) const { return members(robot).name; }
  [[nodiscard]] const Pose2& T_map_robot_start(int robot) const { return members(robot).T_map_robot_start; }

  [[nodiscard]] FleetRecord Next();

  // The true poses at the stamps of the scans so far.
  [[nodiscard]] const Trajectory& truth(int robot) const { return members(robot).truth; }
  // The same since the last call, and forgets them.
  [[nodiscard]] Trajectory TakeTruth(int robot) {
    return std::exchange(robots_[static_cast<std::size_t>(robot)].truth, {});
  }

 private:
  struct Member {
    std::string name;
    Pose2 T_map_robot_start;
    Robot robot;
    Stamp scan_phase = 0;  // From first_stamp to the first scan.
    std::uint64_t scans = 0;
    std::uint64_t odometries = 0;
    Trajectory truth;
  };

  Fleet(Surroundings surroundings, const FleetOptions& options);
  [[nodiscard]] const Member& members(int robot) const { return robots_[static_cast<std::size_t>(robot)]; }
  // The first place on the route, from `way_m` on, that is a metre from every robot placed so far.
  [[nodiscard]] PathPlace FreePlace(const std::vector<Eigen::Vector2d>& waypoints, double way_m) const;
  [[nodiscard]] Stamp NextScan(const Member& member) const;
  [[nodiscard]] Stamp NextOdometry(const Member& member) const;
  // What a robot that begins a scan now will drive until the last beam.
  [[nodiscard]] std::vector<DriveLeg> DriveDuringScan(const Member& member) const;
  // Those that a robot can see closed.
  void AddDoors(const Member& member, double seconds, std::vector<Post>& posts) const;
  // The next record, also one of a robot that sends no odometry.
  [[nodiscard]] FleetRecord Advance();
  [[nodiscard]] Scan TakeScan(std::size_t index, Stamp since_start);

  Surroundings surroundings_;
  FleetOptions options_;
  bool silent_;
  std::vector<Member> robots_;
};

}  // namespace cairn::sim
