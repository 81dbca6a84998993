// Follows the robot from scan to scan. The chosen matcher compares every scan with the last keyframe, and an
// alignment with the points of the last keyframes refines its answer. Odometry gives the pose where neither
// finds one. The result is the motion and its uncertainty. Without the refinement the matcher's own answer is
// used, unless it jumps against the odometry or explains too little of the scan. Matchers of points then keep
// a keyframe as reference while it explains the next ones.
// Frame: `track` is smooth and drifts slowly, like very good odometry. Loops are not closed here but in the
// filter.
// Not thread-safe. Deterministic.
// Source: thesis A 3.5 (voting), 3.5.13 and 3.6.1 (fall-backs, fault check); Censi 2008 (refinement).
#pragma once

#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/features/scan_view.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/matching/scan_matcher.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/tracking/scan_steps.h"
#include "server/slam/tracking/standstill.h"

namespace cairn::slam {

// The forecast of the next scan's pose while the odometry is not used: the robot either stands still or keeps
// its velocity.
struct NoOdometryOptions {
  bool constant_velocity = true;  // Per scan, not per second: the stamps of real logs come in bursts.
  double sigma_m = 0.03;
  double sigma_rad = 0.15;
  double unmatched_step_m = 0.3;
  std::int64_t merged_keyframes = 8;
};
void Visit(OptionVisitor& visitor, NoOdometryOptions& options);

// Other guesses that are tried if the first guess does not explain the scan.
struct RetryOptions {
  double turn_step_rad = 0.25;
  double sigma_m = 0.5;
  double sigma_rad = 0.31622776601683794;  // Its square is 0.1.
};
void Visit(OptionVisitor& visitor, RetryOptions& options);

struct FrontEndOptions {
  FeatureOptions features;
  SurfaceOptions surface;
  bool refine_enabled = true;
  PointToLineOptions refine;
  // Generous: real odometry freezes, jumps and comes late.
  MotionNoise odometry{0.05, 0.8, 0.0, 0.04, 0.4, 1.2};
  bool use_odometry = true;  // False: no odometry, as in thesis C 4.4.
  NoOdometryOptions no_odometry;
  std::int64_t reference_keyframes = 80;
  double retry_below = 0.65;
  RetryOptions retry;
  double keep_above = 0.75;     // See ScanMatcher::keeps_reference.
  double max_jump_sigma = 5.0;  // Fault check of thesis A 3.6.1.
};
void Visit(OptionVisitor& visitor, FrontEndOptions& options);

[[nodiscard]] ScanView Look(const Scan& scan, const FrontEndOptions& options);

// The pose that the front-end finds for one scan, and its evidence.
struct TrackStep {
  Pose2 T_track_robot;
  double score = 0.0;       // Share of the scan that agrees with the last keyframes, 0..1.
  bool matched = false;     // False if the pose comes from odometry or from the forecast.
  bool degenerate = false;  // True in a corridor: the scan does not show the position along it.
  // Then that direction, a unit vector along the axes of `track`, and the information of the scan on the position along
  // it, 1/m^2. Otherwise zero.
  Eigen::Vector2d open_direction = Eigen::Vector2d::Zero();
  double open_information = 0.0;
  // Information of the scan's surfaces on the position, along the axes of `track`, 1/m^2: none along an open direction,
  // and none without a match.
  Eigen::Matrix2d surface_information = Eigen::Matrix2d::Zero();
  double moved_m = 0.0;      // Distance travelled since the previous scan.
  Pose2 T_prev_curr_odom{};  // The step from the previous scan as odometry measured it; none without odometry.
  bool found = false;        // The step leads to where the robot was found again; odometry does not show it.
  // Covariance of the part of the step that neither a scan nor odometry measured (the direction along a
  // corridor, or a scan without a match), along the axes of `track`. It is zero if odometry is used:
  // BlindMotion accounts for that case.
  Eigen::Matrix3d forecast_covariance = Eigen::Matrix3d::Zero();
  // Where a robot that stands is told to be, in `track` (standstill.h). Nothing if it moves.
  std::optional<Pose2> T_track_held{};

  // Steps are stored only after BlindMotion has used what is not in this list, and the pose has been told.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_track_robot, self.score, self.matched, self.degenerate, self.moved_m, self.found,
            self.forecast_covariance);
  }
};

class FrontEnd {
 public:
  // `walk` is the noise of steps that odometry alone shows.
  FrontEnd(const FrontEndOptions& options, ScanMatcher matcher, const OdometryNoise& walk);

  // From now on `watch` is told when kLook, kMatch and kRefine begin.
  void Watch(StepWatch watch) { watch_ = std::move(watch); }
  [[nodiscard]] const StepWatch& watch() const { return watch_; }

  // Returns the pose at this scan. The first scan is at the identity and counts as matched.
  TrackStep Track(const ScanView& view, const Pose2& T_odom_robot, const ParallelFor& parallel_for);
  // The scan just tracked once more, as `view` shows it now: aligned from the pose that was found. Nothing, and no
  // change, if it does not explain more of the scan, or if there is no refinement. Otherwise the result replaces that
  // of Track.
  std::optional<TrackStep> TrackAgain(const ScanView& view, const Pose2& T_odom_robot, const TrackStep& step);
  // The step of odometry from the scan before to the scan just tracked; nothing if there is none before.
  [[nodiscard]] std::optional<Pose2> LastOdometryStep() const;
  // The step between the last two scans, in the frame of the earlier one; nothing if there are fewer.
  [[nodiscard]] std::optional<Pose2> LastStep() const;
  // Makes the scan just tracked part of the reference.
  void AddKeyframe(const ScanView& view);
  // From now on odometry is used, or the scans alone and this matcher (FrontEndOptions::use_odometry).
  void UseOdometry(bool use, ScanMatcher matcher) {
    options_.use_odometry = use;
    matcher_ = std::move(matcher);
  }
  // Odometry before the scan just tracked says nothing about the motion since.
  void ForgetEarlierOdometry() {
    while (history_.size() > 1) history_.pop_front();
    unmatched_m_ = 0.0;
  }
  // Forgets all scans: the next one is at the identity again.
  void Restart();
  // Expresses everything in another frame `new`; the old one is `old`.
  void MoveTo(const Pose2& T_new_old);

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.score_, self.unmatched_m_, self.keyframe_, self.keyframe_view_, self.history_, self.reference_);
    if constexpr (Archive::kReads)
      if (archive.ok()) self.BuildIndices();
    if constexpr (Archive::kReads)
      if (archive.format() < 14) return;  // A robot that stands counts from then on.
    archive(self.standstill_);
  }

 private:
  struct Sight {
    Pose2 T_track_robot;
    Pose2 T_odom_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.T_track_robot, self.T_odom_robot);
    }
  };
  // The pose predicted from the last scan, in `track`: by odometry, or by the forecast if odometry is not
  // used.
  struct Guess {
    Pose2 T_track_robot;
    Eigen::Matrix3d covariance;
  };
  [[nodiscard]] MatchResult Follow(const ScanView& view, const Pose2& T_odom_robot,
                                   const ParallelFor& parallel_for) const;
  [[nodiscard]] TrackStep StepOf(const MatchResult& match, const Pose2& T_odom_robot) const;
  [[nodiscard]] Guess Predict(const Pose2& T_odom_robot) const;
  // Alignment with the reference, from `start`; the result is in `track`. In the direction that the surfaces leave
  // open, odometry with the noise that it usually has decides together with what they show.
  [[nodiscard]] MatchResult Align(const ScanView& view, const Pose2& start, const Guess& guess) const;
  // In the results of the next three functions the reference frame is `track`.
  [[nodiscard]] MatchResult MatchLastKeyframe(const ScanView& view, const Guess& guess,
                                              const ParallelFor& parallel_for) const;
  [[nodiscard]] MatchResult Refine(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                   const MatchResult& coarse) const;
  // The match, unless odometry contradicts it and the surfaces do not show more than odometry (odometry_check.h).
  [[nodiscard]] MatchResult Checked(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                    const MatchResult& match) const;
  [[nodiscard]] MatchResult MatchAlone(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                       const MatchResult& coarse, const ParallelFor& parallel_for) const;
  // Guesses that do not use the odometry since the last scan, for odometry that stood still or came late. One
  // of them is taken only if it explains clearly more of the scan.
  [[nodiscard]] std::vector<Pose2> UnusualGuesses(const Pose2& T_odom_robot) const;
  [[nodiscard]] Eigen::Matrix3d ForecastShare(const MatchResult& match) const;
  // Share of the scan's points that lie on the surfaces of the last keyframe.
  [[nodiscard]] double Explained(const ScanView& view, const Pose2& T_track_robot) const;
  void BuildIndices();
  void BuildKeyframeIndex();
  // Points of the last keyframes, in the robot frame of the newest of them.
  [[nodiscard]] std::vector<SurfacePoint> MergedPoints(std::size_t keyframes) const;

  FrontEndOptions options_;
  ScanMatcher matcher_;
  OdometryNoise walk_;
  StepWatch watch_;
  double score_ = 0.0;  // Score of the last match.
  // The way of the last scans without a match, less that of the scans with one since then: where it is not zero, a
  // match may correct what odometry did wrong on that way.
  double unmatched_m_ = 0.0;
  Standstill standstill_;
  // The reference of the matcher, which mostly is the last keyframe, and its points in its robot frame.
  Sight keyframe_;
  ScanView keyframe_view_;
  PointIndex keyframe_index_;
  std::deque<Sight> history_;                        // The poses of the last scans, newest last.
  std::deque<std::vector<SurfacePoint>> reference_;  // Points of the last keyframes in `track`, newest last.
  PointIndex index_;
};

}  // namespace cairn::slam
