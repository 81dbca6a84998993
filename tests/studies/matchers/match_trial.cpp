#include "tests/studies/matchers/match_trial.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "server/slam/tracking/front_end.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {
namespace {

// Adds discs round the robot until this share of the beams ends on them.
std::vector<sim::Disc> CrowdOf(const Pose2& T_map_robot, const CaseOptions& options, sim::Random& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<sim::Disc> crowd;
  const double wanted = options.moving_share * options.laser.field_of_view_rad;
  for (double covered = 0.0; covered < wanted;) {
    const double range = 0.8 + 2.2 * unit(random), bearing = options.laser.field_of_view_rad * (unit(random) - 0.5);
    const sim::Disc disc{T_map_robot * Eigen::Vector2d(range * std::cos(bearing), range * std::sin(bearing)), 0.25};
    const bool hidden = std::any_of(crowd.begin(), crowd.end(), [&](const sim::Disc& other) {
      return (other.center_map - disc.center_map).norm() < 0.6;
    });
    covered += hidden ? 0.01 : 2 * std::asin(disc.radius_m / range);
    if (!hidden) crowd.push_back(disc);
  }
  return crowd;
}

}  // namespace

MatchCase DrawCase(const Scene& scene, const CaseOptions& options, sim::Random& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int attempt = 0; attempt < 1000; ++attempt) {
    const Pose2 from = scene.DrawPose(random);
    const Pose2 motion{options.max_step_m * unit(random), 0.3 * options.max_step_m * unit(random),
                       options.max_turn_rad * unit(random)};
    if (scene.Clearance(from * motion) < 0.3) continue;
    const auto see = [&](const Pose2& pose) {
      const std::vector<sim::Disc> crowd = CrowdOf(pose, options, random);
      return slam::Look(scene.Look(pose, options.laser, random, crowd), slam::FrontEndOptions{});
    };
    slam::ScanView prev = see(from);
    return {std::move(prev), see(from * motion), motion, from};
  }
  throw std::invalid_argument("no room to move in " + scene.name());
}

MatchTrial TryMatch(const MatchCase& match_case, const Pose2& off, double sigma_m, double sigma_rad,
                    slam::MatcherKind kind, const slam::MatcherOptions& options) {
  const Pose2& truth = match_case.T_ref_curr;
  slam::MatchPrior prior;
  prior.T_ref_curr = {truth.x + off.x, truth.y + off.y, WrapAngle(truth.theta + off.theta)};
  prior.covariance = Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
  MatchTrial trial;
  const Stopwatch watch;
  trial.result = slam::MakeMatcher(kind, options).match(match_case.prev, match_case.curr, prior, slam::SerialFor);
  trial.cpu_ms = watch.CpuMs();
  const Pose2& answer = trial.result.T_ref_curr;
  trial.error = {answer.x - truth.x, answer.y - truth.y, AngleDiff(answer.theta, truth.theta)};
  return trial;
}

std::vector<slam::MatcherKind> BuiltMatchers(std::vector<std::string>& missing) {
  const Scene scene("room");
  sim::Random random(7);
  CaseOptions still;
  still.laser = Sick(0.0);
  still.max_step_m = still.max_turn_rad = 0.0;
  std::vector<slam::MatcherKind> built;
  for (std::size_t i = 0; i < slam::MatcherNames().size(); ++i) {
    const auto kind = static_cast<slam::MatcherKind>(i);
    int good = 0;
    for (int k = 0; k < 5; ++k) good += TryMatch(DrawCase(scene, still, random), {}, 0.1, 0.1, kind, {}).good();
    if (good > 0)
      built.push_back(kind);
    else
      missing.emplace_back(slam::MatcherName(kind));
  }
  return built;
}

}  // namespace cairn::studies
