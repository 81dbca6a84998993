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

struct Model {
  std::string_view name;
  int beams;
  double field_of_view_deg;
  double range_min_m;
  double range_max_m;
  RangeError error;
};

constexpr RangeError Sigma(double sigma_m) {
  return {RangeErrorKind::kSigma, sigma_m, 0.0, 0.0, 0.0, 0.0};
}
constexpr RangeError Fixed(double bound_m) {
  return {RangeErrorKind::kPercent, 0.0, 0.0, bound_m, 0.0, 0.0};
}
constexpr RangeError Step(double bound_m, double bound_share) {
  return {RangeErrorKind::kStep, 0.0, 0.0, bound_m, bound_share, 1.0};
}

// 240 deg at 360/1024 deg a step: 683 beams.
constexpr double kUrgView_deg = 682 * 360.0 / 1024.0;

constexpr Model kModels[] = {
    {"thesis", 181, 180.0, 0.02, 30.0, Sigma(0.015)},  // 5.1.1 simulates a standard deviation of 15 mm.
    {"lms200", 361, 180.0, 0.02, 80.0, Sigma(0.005)},
    {"lms291", 361, 180.0, 0.02, 80.0, Sigma(0.010)},
    {"lms291-s05", 361, 180.0, 0.02, 80.0, Fixed(0.010)},
    {"urg-04lx", 683, kUrgView_deg, 0.06, 4.095, Step(0.010, 0.01)},
    {"urg-04lx-ug01", 683, kUrgView_deg, 0.02, 5.6, Step(0.030, 0.03)},
};

}  // namespace

std::span<const std::string_view> RangeErrorNames() {
  static constexpr std::array<std::string_view, 3> kNames = {"sigma", "percent", "step"};
  return kNames;
}

Result<void> Validate(const RangeError& e) {
  const auto metres = [](double value) { return value >= 0.0 && value <= 10.0; };
  const auto share = [](double value) { return value >= 0.0 && value <= 1.0; };
  if (!metres(e.sigma_m) || !metres(e.bound_m) || !share(e.sigma_share) || !share(e.bound_share))
    return Fail(StatusCode::kInvalidArgument, "laser: noise must be 0..10 m and 0..1 per metre");
  if (!(e.step_m >= 0.0 && e.step_m <= 1000.0))
    return Fail(StatusCode::kInvalidArgument, "laser: the error's step must be at 0..1000 m");
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
  return error.sigma_m + error.sigma_share * range_m;
}

double DrawError(const RangeError& error, double range_m, Random& random) {
  const double scale = ErrorScale(error, range_m);
  if (error.kind == RangeErrorKind::kSigma) return Normal(random, scale);
  return scale > 0.0 ? Uniform(random) * (2.0 * scale) - scale : 0.0;
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

Scan MeasureScan(const Scene& scene, std::span<const Post> posts, const Pose2& T_map_robot, const Twist& twist,
                 Stamp stamp, double tilt_rad, const LaserOptions& options, Random& random) {
  Scan scan;
  scan.stamp = stamp;
  scan.angle_step_rad = StepOf(options);
  scan.angle_first_rad = options.beams == 1 ? 0.0 : -options.field_of_view_rad / 2;
  scan.range_min_m = options.range_min_m;
  scan.range_max_m = options.range_max_m;
  scan.beam_period_s = options.sweep_s / std::max(1, options.beams - 1);
  scan.tilt_rad = tilt_rad;
  scan.T_robot_laser = options.T_robot_laser;
  scan.ranges_m.reserve(static_cast<std::size_t>(options.beams));

  const double cos_tilt = std::cos(tilt_rad), sin_tilt = std::sin(tilt_rad);
  Pose2 T_map_laser = T_map_robot * options.T_robot_laser;
  for (int i = 0; i < options.beams; ++i) {
    if (scan.beam_period_s > 0.0) {
      const double t = i * scan.beam_period_s;
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
      range = std::max(0.0, range + DrawError(options.error, range, random));
    }
    if (range >= options.range_max_m) range = std::numeric_limits<double>::infinity();
    scan.ranges_m.push_back(static_cast<float>(range));
  }
  return scan;
}

std::vector<std::string> LaserModelNames() {
  std::vector<std::string> names;
  for (const Model& model : kModels) names.emplace_back(model.name);
  return names;
}

Result<LaserOptions> WithModel(const LaserOptions& laser, const std::string& name) {
  std::string known;
  for (const Model& model : kModels) {
    if (model.name == name) {
      LaserOptions options = laser;
      options.beams = model.beams;
      options.field_of_view_rad = Radians(model.field_of_view_deg);
      options.range_min_m = model.range_min_m;
      options.range_max_m = model.range_max_m;
      options.error = model.error;
      return options;
    }
    known += (known.empty() ? "" : ", ") + std::string(model.name);
  }
  return Fail(StatusCode::kNotFound, "laser model '" + name + "' is none of: " + known);
}

}  // namespace cairn::sim
