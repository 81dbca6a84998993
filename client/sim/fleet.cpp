#include "client/sim/fleet.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/sim/world.h"

namespace cairn::sim {
namespace {

// The k-th multiple of a rate's period, without the drift of adding periods.
Stamp Multiple(std::uint64_t k, double hz) {
  return static_cast<Stamp>(std::llround(static_cast<double>(k) * 1e9 / hz));
}

// The number of scans during which a robot brakes, and one more while it stands.
int HaltScans(const FleetOptions& o) {
  const double seconds =
      std::max(o.drive.speed_m_s / o.drive.acceleration_m_s2, o.drive.turn_rad_s / o.drive.turn_acceleration_rad_s2);
  return static_cast<int>(std::min(std::ceil(seconds * o.scan_hz), 1e6)) + 2;
}

// Robots that send no odometry steer as often as others do.
constexpr double kSilentHz = 50.0;

}  // namespace

Result<void> Validate(const FleetOptions& o) {
  if (o.robots < 1 || o.robots > 1000) return Fail(StatusCode::kInvalidArgument, "fleet: robots must be 1..1000");
  for (const double hz : {o.scan_hz, o.odometry_hz == 0.0 ? kSilentHz : o.odometry_hz}) {
    if (!(hz >= 0.1 && hz <= 1000.0)) return Fail(StatusCode::kInvalidArgument, "fleet: rates must be 0.1..1000 Hz");
  }
  if (!(o.robot_radius_m > 0.0 && o.robot_radius_m <= 5.0)) {
    return Fail(StatusCode::kInvalidArgument, "fleet: the robots' radius must be above 0 and at most 5 m");
  }
  if (auto valid = Validate(o.laser); !valid) return valid;
  if (!(o.robot_height_m > 0.0 && o.robot_height_m <= 10.0)) {
    return Fail(StatusCode::kInvalidArgument, "fleet: the robots' height must be above 0 and at most 10 m");
  }
  if (auto valid = Validate(o.wheels); !valid) return valid;
  if (auto valid = Validate(o.drive); !valid) return valid;
  if (auto valid = Validate(o.furniture); !valid) return valid;
  return Validate(o.tilt, HaltScans(o));
}

Result<Fleet> Fleet::Create(Surroundings surroundings, const FleetOptions& options) {
  if (auto valid = Validate(options); !valid) return tl::unexpected(valid.error());
  if (surroundings.routes.empty())
    return Fail(StatusCode::kInvalidArgument, "fleet: the world '" + surroundings.name + "' has no route");
  const std::vector<Post> furniture = FurnitureIn(surroundings, options.furniture);
  surroundings.posts.insert(surroundings.posts.end(), furniture.begin(), furniture.end());
  return Fleet(std::move(surroundings), options);
}

Fleet::Fleet(Surroundings surroundings, const FleetOptions& options)
    : surroundings_(std::move(surroundings)), options_(options), silent_(options.odometry_hz == 0.0) {
  if (silent_) options_.odometry_hz = kSilentHz;
  const auto count = static_cast<std::size_t>(options_.robots), routes = surroundings_.routes.size();
  for (std::size_t i = 0; i < count; ++i) {
    const auto& waypoints = surroundings_.routes[i % routes].waypoints_map;
    const std::size_t on_route = (count - i % routes + routes - 1) / routes;
    const std::size_t before_on_route = i / routes;
    const double way_m = ClosedLength(waypoints) * static_cast<double>(before_on_route) / static_cast<double>(on_route);
    const PathPlace place = FreePlace(waypoints, way_m);
    const Pose2 start{place.p_map.x(), place.p_map.y(), WrapAngle(place.heading_rad)};
    std::seed_seq seeds{static_cast<std::uint32_t>(options_.seed), static_cast<std::uint32_t>(options_.seed >> 32),
                        static_cast<std::uint32_t>(i)};
    Random random(seeds);
    const WheelOptions wheels = DrawWheels(options_.wheels, options_.wheel_spread, random);
    const auto phase = static_cast<Stamp>(1e9 / options_.scan_hz * static_cast<double>(i) / static_cast<double>(count));
    robots_.push_back({"robot" + std::to_string(i + 1),
                       start,
                       Robot(start, RouteFollower(waypoints, place.next, options_.drive), wheels, random),
                       phase,
                       0,
                       0,
                       {}});
  }
}

PathPlace Fleet::FreePlace(const std::vector<Eigen::Vector2d>& waypoints, double way_m) const {
  constexpr double kApart_m = 1.0, kStep_m = 0.25;
  const int tries = static_cast<int>(ClosedLength(waypoints) / kStep_m);
  for (int k = 0; k < tries; ++k) {
    PathPlace place = PlaceOnPath(waypoints, way_m + k * kStep_m);
    const bool free = std::all_of(robots_.begin(), robots_.end(), [&](const Member& other) {
      return (other.T_map_robot_start.translation() - place.p_map).norm() >= kApart_m;
    });
    if (free) return place;
  }
  return PlaceOnPath(waypoints, way_m);  // There are too many robots for the route: they may overlap.
}

Stamp Fleet::NextScan(const Member& member) const {
  return member.scan_phase + Multiple(member.scans, options_.scan_hz);
}

Stamp Fleet::NextOdometry(const Member& member) const {
  return Multiple(member.odometries, options_.odometry_hz);
}

std::vector<DriveLeg> Fleet::DriveDuringScan(const Member& member) const {
  std::vector<DriveLeg> legs{{member.robot.seconds(), member.robot.T_map_robot(), member.robot.twist()}};
  if (options_.laser.sweep_s == 0.0) return legs;
  const double end_s = member.robot.seconds() + options_.laser.sweep_s;
  // A copy drives ahead. It stops for odometry where the robot itself will, because the follower steers anew at each
  // stop.
  Robot ahead = member.robot;
  for (std::uint64_t k = member.odometries; ahead.seconds() < end_s; ++k)
    ahead.DriveUntil(SecondsFromStamp(Multiple(k, options_.odometry_hz)), legs);
  return legs;
}

void Fleet::AddDoors(const Member& member, double seconds, std::vector<Post>& posts) const {
  constexpr double kOpensM = 0.8;  // From the centre of a robot.
  std::vector<Disc> leaves;
  for (const Door& door : surroundings_.doors) {
    if (!IsClosed(door, seconds)) continue;
    if (DistanceFrom(door, member.robot.PoseAt(seconds).translation()) > options_.laser.range_max_m + kOpensM) continue;
    const bool opens = std::any_of(robots_.begin(), robots_.end(), [&](const Member& one) {
      return DistanceFrom(door, one.robot.PoseAt(seconds).translation()) < kOpensM;
    });
    if (!opens) AppendLeaf(door, &leaves);
  }
  for (const Disc& disc : leaves) posts.push_back({disc});
}

Scan Fleet::TakeScan(std::size_t index, Stamp since_start) {
  Member& member = robots_[index];
  const double seconds = SecondsFromStamp(since_start);
  std::vector<Post> posts = surroundings_.posts;
  for (const Walker& walker : surroundings_.walkers) posts.push_back({WalkerAt(walker, seconds), kWalkerHeight_m});
  AddDoors(member, seconds, posts);
  if (options_.see_each_other) {
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      if (i == index) continue;
      posts.push_back(
          {{robots_[i].robot.PoseAt(seconds).translation(), options_.robot_radius_m}, options_.robot_height_m});
    }
  }
  const Stamp stamp = options_.first_stamp + since_start;
  const double tilt_rad = TiltOf(member.scans, options_.tilt);
  ++member.scans;
  member.robot.Halt(HaltsAt(member.scans, options_.tilt, HaltScans(options_)));
  Scan scan = MeasureScan(*surroundings_.scene, posts, DriveDuringScan(member), stamp, tilt_rad, options_.laser,
                          member.robot.random());
  scan.sequence = member.scans;
  member.truth.push_back({stamp, member.robot.T_map_robot()});
  return scan;
}

FleetRecord Fleet::Next() {
  for (;;) {
    FleetRecord next = Advance();
    if (!silent_ || std::holds_alternative<Scan>(next.record)) return next;
  }
}

FleetRecord Fleet::Advance() {
  const auto due = [this](const Member& member) { return std::min(NextScan(member), NextOdometry(member)); };
  const auto next = std::min_element(robots_.begin(), robots_.end(),
                                     [&](const Member& a, const Member& b) { return due(a) < due(b); });
  Member& member = *next;
  const auto index = static_cast<std::size_t>(next - robots_.begin());
  const Stamp since_start = due(member);
  member.robot.DriveUntil(SecondsFromStamp(since_start));
  if (NextOdometry(member) == since_start) {
    ++member.odometries;
    return {static_cast<int>(index),
            Odometry{member.odometries, options_.first_stamp + since_start, member.robot.T_odom_robot()}};
  }
  return {static_cast<int>(index), TakeScan(index, since_start)};
}

}  // namespace cairn::sim
