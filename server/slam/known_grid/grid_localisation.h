// Follows a robot in a map that it does not change. Between the fixes the front-end carries the pose; about every
// quarter of a metre the scan is aligned with the surfaces of the map, and the answer is fused with the pose. Where the
// map shows nothing, the pose goes on with growing doubt. Where three standard deviations reach another place it is not
// told as localized, but followed on. The robot is lost where that doubt is too large, or where the scans contradict
// the map over some metres, and it is doubted where somebody may have carried it between two scans
// (recovery/carried.h). It is then looked for as one that was not watched (recovery.h), in this map, until it is found,
// or goes on along its path as one that maps, where only a door has changed. People, and furniture that has moved,
// contradict in some places; that is borne, because it does not contradict for metres everywhere. Frames: `map`;
// `track` is that of the front-end. Not thread-safe. Deterministic. Source: the extended Kalman filter over matches
// with a map of Gutmann, Weigel and Nebel 1999 (thesis B 2.2.2), here with points and surfaces.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/slam/known_grid/known_grid.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/motion/motion_gate.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/recovery/recovery.h"

namespace cairn::slam {

struct GridLocalisationOptions {
  RecoveryOptions recovery{};
  LoopOptions loop;
  SelfCheckOptions self_check;
  PointToLineOptions align;
  SurfaceOptions surface;
  MotionGateOptions gate;
  MotionNoise drift;            // Of a step that scans have measured, ...
  MotionNoise blind;            // ... of a whole motion that odometry alone shows, ...
  OdometryNoise odometry_walk;  // ... and of one that is cut into steps.
  bool uses_odometry = true;
  double lost_after_m = 2.0;
};

class GridLocalisation {
 public:
  explicit GridLocalisation(const GridLocalisationOptions& options);

  void UseOdometry(bool use) {
    options_.uses_odometry = use;
    recovery_.UseOdometry(use);
  }
  // From now on the robot is looked for in this map and then followed: near `known` if somebody says that it is there,
  // otherwise everywhere.
  void Begin(std::shared_ptr<const KnownGrid> map, const Recovery::Known& known, bool said);
  // The map has changed. The next scans must show that the robot is where it was.
  void Replace(std::shared_ptr<const KnownGrid> map);
  // The robot may be anywhere. `odometry_goes_on`: since the last scan.
  void Lose(bool odometry_goes_on);
  // The robot may have been carried since the last scan (carried.h), which agreed with the map as `before` says. The
  // scan after it has this score, and differs at several places (DiffersAtSeveralPlaces) or not. The robot is not
  // localized until that is clear, and looked for if it stays so.
  void Doubt(const SceneAgreement& before, double score, bool at_several_places);
  // Somebody says that it is at this pose.
  void BeginWhereSaid(const Pose2& T_map_robot);

  struct Place {
    Pose2 T_map_robot;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    PoseReason reason = PoseReason::kLost;

    // Neither lost nor with a doubt that reaches another place.
    [[nodiscard]] bool localized() const;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.T_map_robot, self.covariance, self.reason);
      archive.Require(self.reason <= PoseReason::kWaiting, "the reason of a pose");
    }
  };
  // The scan just tracked. `points_robot`: its surfaces.
  struct Sight {
    const Keyframe& scan;
    const std::vector<SurfacePoint>& points_robot;
    const TrackStep& step;
  };
  struct Followed {
    Place place;
    // The front-end should take the scan as its reference. One that shows nothing of where the robot is, or of how it
    // has moved, is none: the scans after it would match with it and hide that the robot may have been carried.
    bool is_reference = false;
  };
  Followed Take(const Sight& sight);

  // Where the track lies in the map, while the robot is followed.
  [[nodiscard]] Pose2 T_map_track() const { return fix_.T_map_robot * fix_.T_track_robot.Inverse(); }
  [[nodiscard]] const Recovery& recovery() const { return recovery_; }
  // Where odometry has taken the robot since the last scan.
  [[nodiscard]] Place CarriedTo(const Pose2& T_odom_robot) const;
  [[nodiscard]] bool looking() const { return recovery_.active(); }
  [[nodiscard]] const std::shared_ptr<const KnownGrid>& map() const { return map_; }
  // Another copy of the same map.
  void ShareMap(std::shared_ptr<const KnownGrid> same) { map_ = std::move(same); }
  // The last place.
  [[nodiscard]] const Place& place() const { return last_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.recovery_, self.fix_, self.comparisons_, self.last_, self.T_odom_robot_, self.T_track_robot_,
            self.T_track_kept_, self.way_m_, self.blind_covariance_, self.unmatched_m_, self.said_);
  }

 private:
  struct Fix {
    Pose2 T_map_robot;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    Pose2 T_track_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.T_map_robot, self.covariance, self.T_track_robot);
    }
  };
  struct Comparison {
    double way_m = 0.0;
    VisibilityCounts counts;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.way_m, self.counts.confirmed, self.counts.contradicted);
    }
  };
  void LookNear();
  Followed Look(const Sight& sight);
  Followed Follow(const Sight& sight);
  // Whether the scans of a doubted robot show that nobody has carried it.
  [[nodiscard]] bool IsCleared(const Sight& sight) const;
  void AddStep(const TrackStep& step);
  [[nodiscard]] Fix Predicted(const TrackStep& step) const;
  // Whether the scan was found in the map there.
  bool Align(const Sight& sight, Fix& fix) const;
  [[nodiscard]] bool Contradicted(const Sight& sight, const Pose2& T_map_robot);

  GridLocalisationOptions options_;
  Recovery recovery_;
  std::shared_ptr<const KnownGrid> map_;
  Fix fix_;
  std::deque<Comparison> comparisons_;
  Place last_;
  Pose2 T_odom_robot_;                                          // Of the last scan.
  Pose2 T_track_robot_;                                         // Of the last scan.
  Pose2 T_track_kept_;                                          // Of the last scan with which the robot was looked for.
  double way_m_ = 0.0;                                          // Along the track.
  Eigen::Matrix3d blind_covariance_ = Eigen::Matrix3d::Zero();  // Since the fix.
  double unmatched_m_ = 0.0;  // Way since a scan has shown how the robot moved, or where it is.
  bool said_ = false;         // The robot is at the last place, says somebody: to be looked for with the next scan.
};

}  // namespace cairn::slam
