// The state of a mapper, for the sources that implement it: mapper.cpp (a robot whose place is known) and
// mapper_recovery.cpp (one whose place has to be confirmed).
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/drawing/map_drawing.h"
#include "server/slam/known_grid/grid_localisation.h"
#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/revisit_search.h"
#include "server/slam/loops/self_check.h"
#include "server/slam/mapper.h"
#include "server/slam/methods.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/recovery/recovery.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan/stamp_gate.h"
#include "server/slam/tracking/blind_motion.h"
#include "server/slam/tracking/front_end.h"
#include "server/slam/tracking/odometry_learning.h"
#include "server/slam/tracking/scan_tracking.h"
#include "server/slam/trail/path_index.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// From one scan to the next: a scan that was measured meanwhile may be deformed.
inline constexpr double kFastTurnRad = 0.1;

struct Mapper::State {
  State(const MapperOptions& given, const Pose2& T_map_robot_start, std::uint64_t seed)
      : configured(given),
        options(given),
        front_end(given.front_end, MakeMatcher(given.matcher, given.matching), given.odometry_walk),
        blind(given.odometry_walk, given.front_end.use_odometry, given.lost_after_m),
        trail(given.filter.back_end.drift, given.front_end.surface),
        revisits(given.revisit, given.front_end.refine),
        filter(MakeFilter(given.filter.kind, given.filter, T_map_robot_start, seed)),
        loops(given.loop, given.front_end.refine),
        self_check(given.self_check),
        recovery(given.recovery, given.loop, given.self_check, given.front_end.refine, given.front_end.surface,
                 given.blind, given.front_end.use_odometry, given.lost_after_m),
        drawing(given.grid),
        learning(given.learning, given.front_end.use_odometry) {}

  // From the next scan on.
  void UseOdometry(bool use);
  [[nodiscard]] bool OdometryStands(const Pose2& T_odom_robot) const;
  [[nodiscard]] MotionSource UseOfOdometry() const;
  Passage ChooseOdometry(Passage passage, const Scan& scan, const Pose2& T_odom_robot);
  void Begin(ScanStep step) const { slam::Begin(front_end.watch(), step); }
  // Mapper::Process, with odometry as it is used.
  ScanOutcome Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot, const ParallelFor& parallel_for,
                      Passage passage, const RollingScan* rolling, bool odometry_begins);
  ScanOutcome Coast(Stamp stamp, const Pose2& T_odom_robot);
  Passage BeginAfter(Passage passage, bool tilted);
  [[nodiscard]] double LastTurn() const;
  void CheckPlace(Passage passage, bool rolling, TrackedScan& tracked, const Pose2& T_odom_robot,
                  const ParallelFor& parallel_for);
  void LosePlace(bool odometry_goes_on);
  void Relocalise(const std::optional<Pose2>& T_map_robot);
  // Before, the next scan defines the start, or the filter itself looks for the robot's place.
  [[nodiscard]] bool HasMap() const { return !trail.empty() && filter->placed(); }
  [[nodiscard]] Recovery::Known LastKnown() const {
    return {level.outcome.T_map_robot, level.T_odom_robot, level.outcome.covariance};
  }
  // Without odometry the robot is expected where it was.
  [[nodiscard]] Pose2 OdometryOrNone(const Pose2& T_odom_robot) const {
    return options.front_end.use_odometry ? T_odom_robot : level.T_odom_robot;
  }
  // What tells that somebody may have carried the robot since the last scan.
  struct SignOfCarrying {
    SceneAgreement before;
    bool at_several_places = false;
  };
  [[nodiscard]] std::optional<SignOfCarrying> BeforeCarried(const Scan& scan,
                                                            const std::vector<SurfacePoint>& points_robot,
                                                            const TrackStep& step) const;
  [[nodiscard]] std::optional<SignOfCarrying> BeforeCarriedInMap(const Scan& scan,
                                                                 const std::vector<SurfacePoint>& points_robot,
                                                                 const TrackStep& step) const;
  void EndDoubt(const Scan& scan, const std::vector<SurfacePoint>& points_robot, const TrackStep& step,
                const ParallelFor& parallel_for);
  void AddHeld(std::span<const Recovery::Held> held, const ParallelFor& parallel_for);
  [[nodiscard]] bool StoodStill(const Scan& scan, const Pose2& T_odom_robot, const TrackStep& step) const;
  [[nodiscard]] bool FollowsOdometry(const Scan& scan, const Pose2& T_odom_robot, const TrackStep& step) const;
  // A map, and where the track lies in it.
  struct TrackInMap {
    const Recovery& recovery;
    const SearchedMap& map;
    Pose2 T_map_track;
  };
  [[nodiscard]] bool AgreesAsBefore(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                    const TrackStep& step, const TrackInMap& track) const;
  [[nodiscard]] bool GoesOn(const Scan& scan, const std::vector<SurfacePoint>& points_robot, const Pose2& T_odom_robot,
                            const TrackStep& step) const;
  [[nodiscard]] Pose2 T_map_track() const {
    return believed_path()[trail.size() - 1] * trail.shapes().back().T_track_robot.Inverse();
  }
  TrackStep DoubtPlace(const ScanView& view, const Pose2& T_odom_robot, const TrackStep& step,
                       const ParallelFor& parallel_for);
  ScanOutcome Recover(Keyframe keyframe, ScanView view, TrackStep step, const ParallelFor& parallel_for);
  [[nodiscard]] ScanOutcome ReportRecovery(Stamp stamp, const Pose2& T_odom_robot, const Pose2& T_track_robot) const;
  void LocaliseIn(std::shared_ptr<const KnownGrid> map, bool place_known);
  Passage LocaliseAfter(Passage passage, bool tilted);
  [[nodiscard]] ScanOutcome ReportLocalised(Stamp stamp, const Pose2& T_odom_robot,
                                            const GridLocalisation::Place& place, double score) const;
  Result<void> MapAgain();
  ScanOutcome Localise(TrackedScan tracked, const Pose2& T_odom_robot, Passage passage, bool rolling,
                       const ParallelFor& parallel_for);
  [[nodiscard]] GridLocalisationOptions LocalisationOptions() const;
  ScanOutcome GoOnAlongPath(const ParallelFor& parallel_for);
  ScanOutcome GoOnAt(const Recovery::Found& found, Keyframe keyframe, ScanView view, TrackStep step,
                     const ParallelFor& parallel_for);
  // What is known of a keyframe besides its step: the old keyframe that the scan shows, or the place of the robot in
  // the map of others. With neither, an old keyframe is searched for.
  struct Regained {
    std::optional<RevisitObservation> revisit;
    std::optional<FilterEstimate> elsewhere;
  };
  void AddKeyframe(Keyframe keyframe, ScanView view, const TrackStep& step, Eigen::Matrix3d step_covariance,
                   const ParallelFor& parallel_for, Regained regained = {});
  [[nodiscard]] Eigen::Matrix3d DoubtOfStep(const Pose2& T_prev_curr) const;
  [[nodiscard]] RevisitObservation SeenFromNearest(const FoundPlace& place) const;
  StepMotion MotionTo(const Keyframe& keyframe, const TrackStep& step, const Eigen::Matrix3d& covariance);
  // Does the next part of the search for one. `keyframe`: the present scan is one.
  void CloseLargeLoop(bool keyframe);
  void RetireKeyframes();
  void Follow(std::span<const Pose2> first_poses, std::uint64_t made);
  void MoveTo(std::span<const Pose2> path, const Pose2& T_map_last);
  void SettlePath();
  [[nodiscard]] std::vector<Pose2> PosesOfFirst(std::uint64_t made, std::span<const Pose2> path,
                                                std::span<const std::uint64_t> numbers) const;
  void KeepShape(std::span<const Pose2> path, std::size_t known);
  void FitRest(std::vector<Pose2>& path, std::size_t known) const;
  void Draw(const TrackStep& step, bool placed_before);
  ScanOutcome Report(Stamp stamp, const Pose2& T_odom_robot, const TrackStep& step, bool keyframe);
  [[nodiscard]] PoseReason ReasonOf(const TrackStep& step) const;
  [[nodiscard]] PosePath believed_path() const { return filter->hypothesis(0).path; }
  // Of the believed path as it is now.
  [[nodiscard]] const PathIndex& believed_index() {
    index.Follow(believed_path());
    return index;
  }

  // All but the filter, which is behind an interface.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.recovery, self.trail, self.front_end, self.blind, self.speed, self.loops, self.self_check,
            self.drawing, self.level, self.last_scan, self.size_after_last_search);
    if constexpr (Archive::kReads)
      if (archive.format() < 8) return;
    LocalisationMembers(archive, self);
    if constexpr (Archive::kReads)
      if (archive.format() < 12) return;
    archive(self.learning);
  }
  template <typename Archive>
  static void LocalisationMembers(Archive& archive, auto& self) {
    bool localises = self.localisation.has_value();
    archive(localises);
    if (!localises || !archive.ok()) return;
    KnownGrid::Source source;
    if constexpr (!Archive::kReads) source = self.localisation->map()->source();
    std::uint64_t count = source.tiles.size();
    archive(source.resolution_m, source.epoch, count);
    if constexpr (Archive::kReads) {
      while (archive.ok() && source.tiles.size() < count) {
        ChunkKey key;
        std::shared_ptr<const TileCells> cells;
        archive(key, cells);
        archive.RequireThat([&] { return cells != nullptr && source.tiles.emplace(key, cells).second; },
                            "the tiles of a known map");
      }
      if (!archive.RequireThat([&] { return KnownGrid::IsBounded(source); }, "the extent of a known map")) return;
      self.localisation.emplace(self.LocalisationOptions());
      self.localisation->Begin(std::make_shared<const KnownGrid>(std::move(source), self.options.recovery.place,
                                                                 self.options.self_check.near_m),
                               {}, false);
    } else {
      for (const auto& [key, cells] : source.tiles) archive(key, cells);
    }
    archive(*self.localisation);
  }

  // The last scan that was reported as part of the path and was not tilted. For `outcome.score` see LastScore.
  struct LevelScan {
    ScanOutcome outcome;
    Pose2 T_keyframe_robot;
    Pose2 T_odom_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.outcome, self.T_keyframe_robot, self.T_odom_robot);
    }
  };

  // The last scan that was not tilted, also while the robot has to be found.
  struct LastScan {
    std::shared_ptr<const Scan> scan;
    Pose2 T_odom_robot;
    Pose2 T_track_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.scan, self.T_odom_robot, self.T_track_robot);
    }
  };

  // How much of the last scan that was not tilted was explained. A robot that is only localised has no other outcome of
  // its own path, so its scores take the place of that of the last scan of its path.
  [[nodiscard]] double LastScore() const { return level.outcome.score; }
  void SetLastScore(double score) { level.outcome.score = score; }

  // Whether the parts fit together after reading.
  [[nodiscard]] bool IsConsistent() const;

  const MapperOptions configured;
  MapperOptions options;     // As they are in use: `configured`, or those for scans alone.
  bool has_odometry = true;  // Mapper::ExpectOdometry.
  FrontEnd front_end;
  BlindMotion blind;
  ConstantSpeed speed;  // Speed of the motion from keyframe to keyframe.
  Trail trail;
  RevisitSearch revisits;
  PathIndex index;  // Follows from the filter's path.
  std::unique_ptr<Filter> filter;
  LoopSearch loops;
  SelfCheck self_check;
  Recovery recovery;
  MapDrawing drawing;
  OdometryLearning learning;
  LevelScan level;
  std::optional<LastScan> last_scan;
  std::optional<GridLocalisation> localisation;  // Of a robot that does not map now.
  std::uint64_t size_after_last_search = 0;      // Number of keyframes left after RetireKeyframes looked last.
};

}  // namespace cairn::slam
