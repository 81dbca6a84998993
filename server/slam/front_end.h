// Follows the robot from scan to scan: matches every scan with what the last keyframes saw, falling back from matching
// to odometry, and says how it moved and how sure that is. Its frame `track` is smooth and drifts slowly, as a very
// good odometry; closing loops is the filter's business. Not thread-safe. Deterministic. Source: thesis A 3.5
// (voting), 3.5.13 and 3.6.1 (fall-backs); Censi 2008 (refinement).
#pragma once

#include <deque>
#include <vector>

#include "common/service/pose_report.h"
#include "server/slam/features/feature_extraction.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/matching/voting.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

struct FrontEndOptions {
  FeatureOptions features;
  VotingOptions voting;
  SurfaceOptions surface;
  PointToLineOptions refine;
  MotionNoise odometry{0.05, 0.8, 0.0, 0.04, 0.4, 1.2};  // Generous: real odometry freezes, jumps, comes late.
  std::int64_t reference_keyframes = 40;  // Scans matched against; more: steadier, until drift blurs them.
  double retry_below = 0.65;              // Score under which other guesses than odometry are tried.
};
void Visit(OptionVisitor& visitor, FrontEndOptions& options);

[[nodiscard]] ScanView Look(const Scan& scan, const FrontEndOptions& options);

struct TrackStep {
  Pose2 T_track_robot;
  MatchResult match;                          // Of the scan against the reference; T_prev_curr is T_track_robot.
  double moved_m = 0.0;                       // Since the scan before.
  MatchFailure voting = MatchFailure::kNone;  // Why the lines alone did not say.
  bool matched = false;                       // False: odometry alone.
};

class FrontEnd {
 public:
  explicit FrontEnd(const FrontEndOptions& options);

  // Where the robot is now. The first scan is at the identity.
  TrackStep Track(const ScanView& view, const Pose2& T_odom_robot);
  // Makes the scan just tracked part of the reference.
  void AddKeyframe(const ScanView& view);

 private:
  struct Sight {
    Pose2 T_track_robot;
    Pose2 T_odom_robot;
  };
  MatchResult Align(const ScanView& view, const Pose2& T_odom_robot, MatchFailure& voting) const;

  FrontEndOptions options_;
  bool started_ = false;
  Pose2 T_track_robot_;
  Sight keyframe_;  // The last keyframe, and its features in its robot frame.
  ScanFeatures keyframe_features_;
  std::deque<Sight> history_;                        // The last scans, newest last.
  std::deque<std::vector<SurfacePoint>> reference_;  // In track, newest last.
  PointIndex index_;
};

}  // namespace cairn::slam
