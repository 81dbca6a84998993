// One comparison of two simulated scans by one matcher, with the truth. All parts of `cairn-study matchers`
// use it.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "server/slam/methods.h"
#include "tests/studies/scene.h"

namespace cairn::studies {

struct MatchCase {
  slam::ScanView prev;
  slam::ScanView curr;
  Pose2 T_ref_curr;  // The truth.
  Pose2 T_map_prev;
};

struct CaseOptions {
  sim::LaserOptions laser = Sick(0.01);
  double max_step_m = 0.3;
  double max_turn_rad = Radians(12.0);
  double moving_share = 0.0;  // Share of the beams that end on discs which are elsewhere in the other scan.
};

// Draws a trial at a random place on the scene's routes.
[[nodiscard]] MatchCase DrawCase(const Scene& scene, const CaseOptions& options, sim::Random& random);

struct MatchTrial {
  slam::MatchResult result;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();  // x, y (m) in prev; theta (rad).
  double cpu_ms = 0.0;
  [[nodiscard]] double metres() const { return error.head<2>().norm(); }
  [[nodiscard]] bool near() const { return metres() < 0.10 && std::abs(error.z()) < Radians(2.0); }
  [[nodiscard]] bool good() const { return result.converged && near(); }
  [[nodiscard]] bool wrong() const {
    return result.converged && !result.degenerate && !near();
  }  // Wrong, and not flagged.
};

// The prior is the truth plus `off` (x, y, theta), with these standard deviations.
[[nodiscard]] MatchTrial TryMatch(const MatchCase& match_case, const Pose2& off, double sigma_m, double sigma_rad,
                                  slam::MatcherKind kind, const slam::MatcherOptions& options);

// The matchers of this build: those that align two identical scans from the right guess. The names of the others are
// added to `missing`.
[[nodiscard]] std::vector<slam::MatcherKind> BuiltMatchers(std::vector<std::string>& missing);

}  // namespace cairn::studies
