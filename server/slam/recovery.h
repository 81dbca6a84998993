// A robot whose place is not known for sure: scans are missing, and its scan does not agree with the map where odometry
// says that it is; or odometry has begun anew. Its pose is carried on by odometry where there is any, nothing is drawn,
// and it is not localized until it has been found in its own map (loops/place_search.h):
//  - at once, if the place found is the one to which odometry has taken it (after odometry began anew: the last known
//    place, where most robots stand that were switched off and on);
//  - elsewhere only if a second search agrees after some more way.
// The front-end follows the robot meanwhile, in a frame of its own. Not thread-safe. Deterministic.
#pragma once

#include <deque>
#include <optional>

#include "common/service/pose_report.h"
#include "server/slam/loops/place_search.h"
#include "server/slam/motion/step_motion.h"

namespace cairn::slam {

class Recovery {
 public:
  // What was known last.
  struct Known {
    Pose2 T_map_robot;
    Pose2 T_odom_robot;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.T_map_robot, self.T_odom_robot, self.covariance);
    }
  };
  // The pose meanwhile.
  struct Belief {
    Pose2 T_map_robot;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d doubt = Eigen::Matrix3d::Zero();  // The part of the covariance that has come since.
    PoseReason reason = PoseReason::kLost;            // Or kOdometryOnly.
  };

  // `blind` is the noise of motion known by odometry alone.
  Recovery(const LoopOptions& loop, const SelfCheckOptions& check, const PointToLineOptions& align,
           const MotionNoise& blind, double lost_after_m)
      : loop_(loop), search_(loop, check, align), blind_(blind), lost_after_m_(lost_after_m) {}

  [[nodiscard]] bool active() const { return active_; }
  [[nodiscard]] const PlaceSearch& search() const { return search_; }
  // `odometry_goes_on`: the odometry since `known` is that of one drive.
  void Begin(const Known& known, bool odometry_goes_on);
  // The odometry has begun anew.
  void OdometryBeganAnew() { odometry_goes_on_ = false; }
  void End();

  // The last scans do not belong together with the next one.
  void ForgetScans();
  [[nodiscard]] bool has_scans() const { return !recent_.scans.empty(); }
  // Motion from the last scan taken. REQUIRES: has_scans().
  [[nodiscard]] Pose2 FromLast(const Pose2& T_track_robot) const;
  // Takes a scan with its pose in the front-end's frame, and searches. Returns its place once it is known.
  [[nodiscard]] std::optional<FoundPlace> Take(std::shared_ptr<const Scan> scan, const Pose2& T_track_robot,
                                               const Pose2& T_odom_robot, std::vector<SurfacePoint> points_robot,
                                               const Trail& trail, const SharedSequence<Pose2>& path);
  [[nodiscard]] Belief BeliefAt(const Pose2& T_odom_robot) const;
  // Whether a place is the one to which odometry has taken the robot, within the doubt about both.
  [[nodiscard]] bool IsWhereExpected(const Pose2& T_map_robot, const Belief& belief) const;

  void RestorePoints(const SurfaceOptions& options) { recent_.RestorePoints(options); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.active_, self.odometry_goes_on_, self.contradicted_, self.known_, self.searched_at_m_, self.recent_,
            self.unconfirmed_);
    if constexpr (Archive::kReads) self.search_.Forget();
  }

 private:
  // A place found that is not yet confirmed.
  struct Candidate {
    Pose2 T_map_track;
    double travelled_m = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.T_map_track, self.travelled_m);
    }
  };
  [[nodiscard]] bool IsConfirmed(const Pose2& T_map_robot);

  LoopOptions loop_;
  PlaceSearch search_;
  MotionNoise blind_;
  double lost_after_m_;
  bool active_ = false;
  bool odometry_goes_on_ = false;
  bool contradicted_ = false;  // The last scan does not fit where odometry says that the robot is.
  Known known_;
  double searched_at_m_ = 0.0;
  RecentScans recent_;
  std::deque<Candidate> unconfirmed_;
};

}  // namespace cairn::slam
