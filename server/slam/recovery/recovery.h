// Follows a robot whose place is not certain: scans are missing, or odometry has begun anew. The robot is not
// localized, and nothing is drawn, until it has been found in its own map (place_search.h). It has been found
// when two searches, with some way between them, agree: one scan or one search is no proof, because places look alike.
//  - While the scans continue those before the pause, the robot is probably on its path: its scans are held, and are
//    added to the path as if there had been no pause, if the place found is that one (`on_path`).
//  - Otherwise its pose is carried on by odometry where there is any, and the path goes on at the place found.
//  - Where somebody has said where the robot is, one search near there that finds it is enough (`BeginWhereSaid`).
//  - Where a job has found the robot in the map of its site, which shows more than that of the robot (`Suggest`), that
//    was the first of the two searches, and the second one is made in that map. If the map of the robot does not show
//    the place as well, it is no place relative to what the robot has seen before (`Found::elsewhere`).
//  - A robot that may have been carried between two scans (carried.h) is first held on its path as well, if its scans
//    match. It is looked for if within kMostDoubtedM of way they have not shown that nobody has carried it, and at once
//    where a scan does not match. It goes on along its path if that was not likely and it is found nowhere else.
//  - The whole map is searched in parts, one with each scan taken, so that no scan takes long. Which parts are done
//    follows from the scans since it began, so that a restarted server goes on in the same way.
//  - A robot that has been followed in the map of others, with too much doubt (`BeginNear`), is found by one search
//    where the track leads, and elsewhere by two that agree, like all others. At the edge of the map, where the place
//    explains little of what the robot sees, four searches must agree.
// Frames: `track` is that of the front-end. Not thread-safe. Deterministic.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/service/pose_report.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/recovery/carried.h"
#include "server/slam/recovery/place_search.h"
#include "server/slam/tracking/front_end.h"

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
    PoseReason reason = PoseReason::kLost;  // Or kOdometryOnly.
  };
  // A keyframe that waits until it is known that the robot is on its path.
  struct Held {
    Keyframe keyframe;
    TrackStep step;
    Eigen::Matrix3d step_covariance = Eigen::Matrix3d::Zero();

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      Keyframe::InlineMembers(archive, self.keyframe);
      archive(self.step, self.step_covariance);
    }
  };
  struct Found {
    FoundPlace place;
    bool on_path = false;  // Then the held keyframes belong to the path.
    // Only the map of others shows the place. That of the robot may have its places elsewhere, so that this does not
    // say where the robot is relative to them.
    bool elsewhere = false;
  };

  // `blind` is the noise of motion known by odometry alone.
  Recovery(const RecoveryOptions& options, const LoopOptions& loop, const SelfCheckOptions& check,
           const PointToLineOptions& align, const SurfaceOptions& surface, const MotionNoise& blind, bool uses_odometry,
           double lost_after_m)
      : options_(options),
        loop_(loop),
        search_(options.place, loop, check, align),
        surface_(surface),
        blind_(blind),
        uses_odometry_(uses_odometry),
        lost_after_m_(lost_after_m) {}

  void UseOdometry(bool use) { uses_odometry_ = use; }
  [[nodiscard]] bool active() const { return active_; }
  // `odometry_goes_on`: the odometry since `known` is that of one drive.
  void Begin(const Known& known, bool odometry_goes_on);
  // Somebody says that the robot is at `known.T_map_robot`.
  void BeginWhereSaid(const Known& known);
  // The robot has been followed on, but with too much doubt: it is looked for within that doubt around where the track
  // leads, and only now and then everywhere.
  void BeginNear(const Known& known, const Pose2& T_map_track);
  // The next scans continue the path: `T_map_track` is its pose in the map.
  void BeginOnPath(const Known& known, const Pose2& T_map_track);
  // Whether it is looked for where somebody says that it is, and not where it has been followed to.
  [[nodiscard]] bool was_said() const { return active_ && said_ && !on_path(); }
  [[nodiscard]] bool on_path() const { return T_map_track_.has_value(); }
  // The map has moved by this where the robot was last.
  void Move(const Pose2& T_new_old);
  // The map is another one now.
  void ForgetMap() {
    suggestion_.reset();
    unconfirmed_.clear();
    StopSearch();
    search_.Forget();
  }
  // A job has found the robot in another map: it was at `T_map_robot` when it saw the scan of this stamp. From now on
  // that place is looked at, in that map, until the robot is found, or has driven kConfirmWithinM, or its scans do not
  // continue that one, or it is found elsewhere in its own map. False, and nothing is changed: it is not one of the
  // last scans, or the robot has just been found elsewhere in its own map, which is not confirmed yet.
  [[nodiscard]] bool Suggest(Stamp seen, const Pose2& T_map_robot, std::shared_ptr<const SearchedMap> map);
  [[nodiscard]] bool suggested() const { return suggestion_.has_value(); }
  void ForgetSuggestion() { suggestion_.reset(); }
  // Called with each scan: a suggestion does not last for ever, also if the robot stands still.
  void AgeSuggestion();
  // The last scans, if they belong together with the next one.
  [[nodiscard]] const std::vector<RecentScan>& recent() const { return recent_; }
  // A robot on its path may have been carried since the last scan.
  struct Doubt {
    SceneAgreement before;  // Of the last scan with the last keyframes.
    // Most of the scan after it was not explained, or it differed at several places, or since then its map has shown it
    // elsewhere: at the place where its scans fit best nothing contradicted them, whether or not it has rivals, as in a
    // corridor of equal rooms.
    bool likely = false;
    bool searched = false;  // The whole map has been searched for the robot since then.

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.before, self.likely);
      bool has_searched = true;
      if constexpr (Archive::kReads) has_searched = archive.format() >= 14;
      if (has_searched) archive(self.searched);
    }
  };
  // `score` is that of the scan with which it begins, `at_several_places`: DiffersAtSeveralPlaces. REQUIRES: on_path.
  void BeginDoubt(const SceneAgreement& before, double score, bool at_several_places) {
    doubt_ = Doubt{before, at_several_places || score < options_.place.min_explained, false};
  }
  [[nodiscard]] const std::optional<Doubt>& doubt() const { return doubt_; }
  // Whether it has been doubted for so long that it counts as carried.
  [[nodiscard]] bool was_carried() const { return doubt_ && has_scans() && recent_.back().travelled_m > kMostDoubtedM; }
  // Whether it was not likely, and has been found nowhere else on so much way that something else must have changed: a
  // door was closed, or furniture was moved.
  [[nodiscard]] bool doubted_in_vain() const {
    return doubt_ && !doubt_->likely && doubt_->searched && has_scans() && recent_.back().travelled_m > kDoubtedInVainM;
  }
  // Where the robot may be now: at the places found that are not confirmed.
  [[nodiscard]] std::vector<Pose2> Unconfirmed() const;
  // The odometry has begun anew.
  void OdometryBeganAnew() { odometry_goes_on_ = false; }
  void End();

  // The last scans do not belong together with the next one.
  void ForgetScans();
  [[nodiscard]] bool has_scans() const { return !recent_.empty(); }
  // The pose in `track` of the last scan that was held or, off the path, taken; `otherwise` if there is none.
  [[nodiscard]] Pose2 LastKept(const Pose2& otherwise) const {
    if (on_path()) return held_.empty() ? otherwise : held_.back().step.T_track_robot;
    return has_scans() ? recent_.back().T_track_robot : otherwise;
  }
  [[nodiscard]] std::vector<Held> TakeHeld() { return std::exchange(held_, {}); }
  void Hold(Held held) { held_.push_back(std::move(held)); }

  // Takes a scan, and searches, unless the robot is only doubted. Returns the robot's place once it is confirmed.
  [[nodiscard]] std::optional<Found> Take(const Keyframe& keyframe, const TrackStep& step,
                                          std::vector<SurfacePoint> points_robot, const SearchedMap& map);
  // How a scan at this pose agrees with what earlier scans have shown there.
  [[nodiscard]] PlaceSearch::Agreement Compare(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                               const Pose2& T_map_robot, const SearchedMap& map) const {
    return search_.Compare(map, scan, points_robot, T_map_robot);
  }
  [[nodiscard]] Belief BeliefAt(const Pose2& T_odom_robot, const Pose2& T_track_robot) const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.active_, self.odometry_goes_on_, self.said_, self.contradicted_, self.known_, self.T_map_track_,
            self.searched_at_m_, self.recent_, self.held_, self.unconfirmed_);
    bool has_doubt = true;
    if constexpr (Archive::kReads) has_doubt = archive.format() >= 13;
    if (has_doubt) archive(self.doubt_);
    bool searching = true;  // Before format 14 all searches ended with the scan with which they began.
    if constexpr (Archive::kReads) {
      if (archive.format() >= 14) archive(searching);
    } else {
      searching = self.search_.searching() || self.restored_;
      archive(searching);
    }
    if constexpr (Archive::kReads) {
      self.search_.Forget();
      self.restored_ = searching;
      self.suggestion_.reset();  // Not saved (Mapper::has_suggestion).
      archive.Require(!self.doubt_ || (self.active_ && !self.said_ && self.on_path()),
                      "a robot that may have been carried");
      if (archive.ok()) self.RestorePoints();
    }
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
  // A place found by a job.
  struct Suggestion {
    Candidate place;
    std::shared_ptr<const SearchedMap> map;
    PlaceSearch search;
    int scans_left = 0;
  };
  // The place of the last scan, if it is the suggested one.
  [[nodiscard]] std::optional<FoundPlace> ConfirmSuggestion();
  void RestorePoints();
  [[nodiscard]] Pose2 FromLast(const Pose2& T_track_robot) const;
  void Append(const Keyframe& keyframe, const TrackStep& step, std::vector<SurfacePoint> points_robot);
  // Of the recent scans: those of the last kStretchM, at most kMaxRecent. REQUIRES: none is being searched for.
  void KeepLastStretch();
  void LeavePath();
  void BeginSearch(const SearchedMap& map, std::span<const RecentScan> recent);
  void StopSearch();
  void SearchAgain(const SearchedMap& map);
  [[nodiscard]] int BlocksPerScan() const;
  [[nodiscard]] std::optional<FoundPlace> SearchOn(const SearchedMap& map);
  [[nodiscard]] std::optional<FoundPlace> FindNearTrack(const SearchedMap& map, const Pose2& T_map_robot);
  [[nodiscard]] std::span<const RecentScan> LastPart() const;
  [[nodiscard]] std::pair<double, double> ReachOfTrack() const;
  [[nodiscard]] bool IsNear(const Pose2& T_map_believed, const Pose2& T_map_found) const;
  // `seen_m`: the way at the last of the scans that were searched for.
  [[nodiscard]] bool IsConfirmed(const Pose2& T_map_robot, double seen_m);
  [[nodiscard]] bool Agree(const Candidate& earlier, const Pose2& T_map_robot) const;

  RecoveryOptions options_;
  LoopOptions loop_;
  PlaceSearch search_;
  SurfaceOptions surface_;
  MotionNoise blind_;
  bool uses_odometry_;
  double lost_after_m_;
  bool active_ = false;
  bool odometry_goes_on_ = false;
  bool said_ = false;          // `known_` is where somebody says that the robot is, or where it has been followed to.
  bool contradicted_ = false;  // The last scan does not fit where the robot is believed to be.
  Known known_;
  std::optional<Pose2> T_map_track_;  // While the scans continue the path.
  std::optional<Doubt> doubt_;
  double searched_at_m_ = -1.0;  // The way at the last of the scans that are, or were last, searched for everywhere.
  bool restored_ = false;        // What has been searched for in parts is still to be searched for again.
  std::vector<RecentScan> recent_;
  std::vector<Held> held_;  // While the scans continue the path: those that will be its keyframes.
  std::vector<Candidate> unconfirmed_;
  std::optional<Suggestion> suggestion_;  // Not part of a checkpoint: it has a map of its own.
};

}  // namespace cairn::slam
