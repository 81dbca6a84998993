#include "client/sim/laser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>
#include <vector>

#include "client/sim/arc.h"

namespace cairn::sim {
namespace {

Result<void> Require(bool holds, const char* what) {
  if (holds) return {};
  return Fail(StatusCode::kInvalidArgument, std::string("laser: ") + what);
}

double StepOf(const LaserOptions& options) {
  const bool full_turn = options.field_of_view_rad > 2 * kPi - 1e-9;
  return options.field_of_view_rad / (full_turn ? options.beams : std::max(1, options.beams - 1));
}

}  // namespace

std::span<const std::string_view> RangeErrorNames() {
  static constexpr std::array<std::string_view, 3> kNames = {"sigma", "percent", "step"};
  return kNames;
}

Result<void> Validate(const RangeError& e) {
  const auto metres = [](double value) { return value >= 0.0 && value <= 10.0; };
  const auto share = [](double value) { return value >= 0.0 && value <= 1.0; };
  if (!metres(e.sigma_m) || !metres(e.sigma_far_m) || !metres(e.bound_m) || !share(e.sigma_share) ||
      !share(e.bound_share))
    return Fail(StatusCode::kInvalidArgument, "laser: noise must be 0..10 m and 0..1 per metre");
  if (!(e.step_m >= 0.0 && e.step_m <= 1000.0))
    return Fail(StatusCode::kInvalidArgument, "laser: the error's step must be at 0..1000 m");
  if (!(std::abs(e.bias_m) <= 10.0 && std::abs(e.bias_share) <= 0.5))
    return Fail(StatusCode::kInvalidArgument, "laser: the bias must be within +-10 m and +-0.5 per metre");
  if (!(e.quantum_m >= 0.0 && e.quantum_m <= 1.0))
    return Fail(StatusCode::kInvalidArgument, "laser: the quantum must be 0..1 m");
  return {};
}

double ErrorScale(const RangeError& error, double range_m) {
  switch (error.kind) {
    case RangeErrorKind::kPercent:
      return error.bound_m + error.bound_share * range_m;
    case RangeErrorKind::kStep:
      return range_m <= error.step_m ? error.bound_m : error.bound_share * range_m;
    case RangeErrorKind::kSigma:
      break;
  }
  const bool far = error.sigma_far_m > 0.0 && range_m > error.step_m;
  return (far ? error.sigma_far_m : error.sigma_m) + error.sigma_share * range_m;
}

double DrawError(const RangeError& error, double range_m, Random& random) {
  const double scale = ErrorScale(error, range_m);
  if (error.kind == RangeErrorKind::kSigma) return Normal(random, scale);
  return scale > 0.0 ? Uniform(random) * (2.0 * scale) - scale : 0.0;
}

double Measured(const RangeError& error, double range_m, Random& random) {
  double measured = range_m + DrawError(error, range_m, random) + error.bias_m + error.bias_share * range_m;
  if (error.quantum_m > 0.0) measured = std::round(measured / error.quantum_m) * error.quantum_m;
  return std::max(0.0, measured);
}

Result<void> Validate(const LaserOptions& o) {
  const auto share = [](double value) { return value >= 0.0 && value <= 1.0; };
  if (auto r = Require(o.beams >= 1 && o.beams <= kMaxBeams, "beams must be 1..8192"); !r) return r;
  if (auto r = Require(o.field_of_view_rad > 0.0 && o.field_of_view_rad <= 2 * kPi + 1e-9,
                       "field of view must be above 0 and at most 360 deg");
      !r)
    return r;
  if (auto r = Require(o.range_min_m >= 0.0 && o.range_min_m < o.range_max_m && o.range_max_m <= 1000.0,
                       "ranges must be 0 <= min < max <= 1000 m");
      !r)
    return r;
  if (auto r = Validate(o.error); !r) return r;
  if (auto r = Require(o.height_m >= 0.0 && o.height_m <= 100.0, "the height must be 0..100 m"); !r) return r;
  if (auto r = Require(share(o.dropout_share), "dropouts must be a share from 0 to 1"); !r) return r;
  if (auto r = Require(o.sweep_s >= 0.0 && o.sweep_s <= 1.0, "the sweep must take 0..1 s"); !r) return r;
  return Require(o.T_robot_laser.IsFinite(), "the mounting must be finite");
}

Scan MeasureScan(const Scene& scene, std::span<const Post> posts, std::span<const DriveLeg> drive, Stamp stamp,
                 double tilt_rad, const LaserOptions& options, Random& random) {
  Scan scan;
  scan.stamp = stamp;
  const double sense = options.clockwise ? -1.0 : 1.0;
  scan.angle_step_rad = sense * StepOf(options);
  scan.angle_first_rad = options.beams == 1 ? 0.0 : -sense * options.field_of_view_rad / 2;
  scan.range_min_m = options.range_min_m;
  scan.range_max_m = options.range_max_m;
  scan.beam_period_s = options.sweep_s / std::max(1, options.beams - 1);
  scan.tilt_rad = tilt_rad;
  scan.T_robot_laser = options.T_robot_laser;
  scan.ranges_m.reserve(static_cast<std::size_t>(options.beams));

  const double cos_tilt = std::cos(tilt_rad), sin_tilt = std::sin(tilt_rad);
  Pose2 T_map_laser = drive.front().T_map_robot * options.T_robot_laser;
  std::size_t leg = 0;
  for (int i = 0; i < options.beams; ++i) {
    if (scan.beam_period_s > 0.0) {
      const double now_s = drive.front().from_s + i * scan.beam_period_s;
      while (leg + 1 < drive.size() && drive[leg + 1].from_s <= now_s) ++leg;
      const auto& [from_s, T_map_robot, twist] = drive[leg];
      const double t = now_s - from_s;
      T_map_laser = T_map_robot * DriveArc(twist.speed_m_s * t, twist.turn_rad_s * t) * options.T_robot_laser;
    }
    const double bearing = scan.angle_first_rad + i * scan.angle_step_rad;
    Eigen::Vector3d direction;
    if (tilt_rad == 0.0) {
      const double angle = T_map_laser.theta + bearing;
      direction = {std::cos(angle), std::sin(angle), 0.0};
    } else {
      const Eigen::Vector2d level =
          T_map_laser.rotation() * Eigen::Vector2d(std::cos(bearing) * cos_tilt, std::sin(bearing));
      direction = {level.x(), level.y(), -std::cos(bearing) * sin_tilt};
    }
    const Eigen::Vector3d origin(T_map_laser.x, T_map_laser.y, options.height_m);
    double range = std::min(scene.Cast(origin, direction, options.range_max_m), CastAtPosts(posts, origin, direction));
    if (options.dropout_share > 0.0 && Uniform(random) < options.dropout_share) {
      range = 0.0;
    } else if (range < options.range_max_m) {
      range = Measured(options.error, range, random);
    }
    if (range >= options.range_max_m) range = std::numeric_limits<double>::infinity();
    scan.ranges_m.push_back(static_cast<float>(range));
  }
  return scan;
}

}  // namespace cairn::sim
