// Follows the robot from scan to scan: the chosen matcher compares every scan with the last keyframe, an alignment with
// what the last keyframes saw refines its answer, odometry stands in where neither knows; and says how it moved and how
// sure that is. Without the refinement the matcher's own answer counts, unless it jumps against the odometry or
// explains too little of the scan; matchers of points then keep a keyframe as reference while it explains the next
// ones. Its frame `track` is smooth and drifts slowly, as a very good odometry; closing
// loops is the filter's business. Not thread-safe. Deterministic. Source: thesis A 3.5 (voting), 3.5.13 and 3.6.1
// (fall-backs, fault check); Censi 2008 (refinement).
#pragma once

#include <deque>
#include <vector>

#include "common/service/pose_report.h"
#include "server/slam/features/feature_extraction.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/matching/scan_matching.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

// What is believed of the next scan's pose while the odometry is withheld: the robot stands still, or goes on as it
// did.
struct NoOdometryOptions {
  bool constant_velocity = true;  // Per scan, not per second: stamps of real logs come in bursts.
  double sigma_m = 0.03;          // Of the prediction; larger: what scans seem to show along a corridor counts more.
  double sigma_rad = 0.15;
  double unmatched_step_m = 0.3;  // What a scan without a match counts as travelled, towards being lost.
  // The matcher compares with what these saw, of the reference_keyframes kept; more: less pull towards standing still.
  std::int64_t merged_keyframes = 8;
};
void Visit(OptionVisitor& visitor, NoOdometryOptions& options);

struct FrontEndOptions {
  FeatureOptions features;
  SurfaceOptions surface;
  bool refine_enabled = true;  // False: the matcher's own answer is the pose.
  PointToLineOptions refine;
  MotionNoise odometry{0.05, 0.8, 0.0, 0.04, 0.4, 1.2};  // Generous: real odometry freezes, jumps, comes late.
  bool use_odometry = true;                              // False: tracking and mapping see scans only (thesis C 4.4).
  NoOdometryOptions no_odometry;
  std::int64_t reference_keyframes = 40;  // Scans matched against; more: steadier, until drift blurs them.
  double retry_below = 0.65;              // Score under which other guesses than odometry are tried.
  double keep_above = 0.75;               // Without refinement: score from which the reference stays (KeepsReference).
  double max_jump_sigma = 5.0;  // Without refinement: a matcher's answer farther from odometry is a fault (3.6.1).
};
void Visit(OptionVisitor& visitor, FrontEndOptions& options);

[[nodiscard]] ScanView Look(const Scan& scan, const FrontEndOptions& options);

struct TrackStep {
  Pose2 T_track_robot;
  MatchResult match;                           // Of the scan against the reference; T_prev_curr is T_track_robot.
  double moved_m = 0.0;                        // Since the scan before.
  MatchFailure matcher = MatchFailure::kNone;  // Why the matcher alone did not say.
  bool matched = false;                        // False: odometry alone.
  // Of what no scan and no odometry showed of this step, along track's axes: a corridor's way, a scan unmatched. Zero
  // where odometry is used, which the mapper accounts for.
  Eigen::Matrix3d forecast_covariance = Eigen::Matrix3d::Zero();
};

class FrontEnd {
 public:
  FrontEnd(const FrontEndOptions& options, MatcherKind matcher, const MatcherOptions& matching);

  // Where the robot is now. The first scan is at the identity.
  TrackStep Track(const ScanView& view, const Pose2& T_odom_robot, const ParallelFor& parallel_for);
  // Makes the scan just tracked part of the reference.
  void AddKeyframe(const ScanView& view);

 private:
  struct Sight {
    Pose2 T_track_robot;
    Pose2 T_odom_robot;
  };
  // Where the robot is by odometry since the last scan, or by the forecast that stands in for it, in track.
  struct Guess {
    Pose2 T_track_robot;
    Eigen::Matrix3d covariance;
  };
  [[nodiscard]] Guess Predict(const Pose2& T_odom_robot) const;
  [[nodiscard]] MatchResult MatchLastKeyframe(const ScanView& view, const Guess& guess,
                                              const ParallelFor& parallel_for) const;
  [[nodiscard]] MatchResult Refine(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                   const MatchResult& coarse) const;
  [[nodiscard]] MatchResult MatchAlone(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                       const MatchResult& coarse, const ParallelFor& parallel_for) const;
  // Without odometry since the last scan: it stood still, or came late. The scan must explain these clearly better.
  [[nodiscard]] std::vector<Pose2> UnusualGuesses(const Pose2& T_odom_robot) const;
  [[nodiscard]] Eigen::Matrix3d ForecastShare(const MatchResult& match) const;
  // Share of the scan that lies on what the last keyframe saw.
  [[nodiscard]] double Explained(const ScanView& view, const Pose2& T_track_robot) const;
  // What the last keyframes saw, in the robot frame of the last of them.
  [[nodiscard]] std::vector<SurfacePoint> MergedPoints(std::size_t keyframes) const;

  FrontEndOptions options_;
  MatcherKind matcher_;
  MatcherOptions matching_;
  bool started_ = false;
  Pose2 T_track_robot_;
  double score_ = 0.0;  // Of the last match.
  Sight keyframe_;  // What the matcher compares with, the last keyframe mostly, and what it saw, in its robot frame.
  ScanView keyframe_view_;
  PointIndex keyframe_index_;
  std::deque<Sight> history_;                        // The last scans, newest last.
  std::deque<std::vector<SurfacePoint>> reference_;  // In track, newest last.
  PointIndex index_;
};

}  // namespace cairn::slam
