// The estimator of one robot: its inputs are scans and odometry, its results are the pose, landmarks and an
// occupancy grid. `mapper.cpp` calls the parts of server/slam in their order. The same options, seed, start
// and inputs give the same bytes, on any number of threads. Not thread-safe: one session owns one mapper.
// Inputs must be validated (ValidateScan) and paired (OdometryPairing) first.
// Source: thesis A, chapters 3 and 4 (feature-based scan matching with FastSLAM 2.0).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/sensor/scan.h"
#include "common/service/learned_value.h"
#include "common/service/pose_report.h"
#include "common/status.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/known_grid/known_grid.h"
#include "server/slam/landmarks/landmark.h"
#include "server/slam/mapper_options.h"
#include "server/slam/parallel_for.h"
#include "server/slam/recovery/place_search.h"
#include "server/slam/scan/scan_motion.h"
#include "server/slam/tracking/scan_steps.h"
#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

// The result of one scan.
struct ScanOutcome {
  Stamp stamp = 0;
  // Online estimate of the best hypothesis. While the robot's place in the map is not known (kLost, filter.h:
  // placed), it is relative to the start.
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // (x, y, theta) in map.
  Pose2 T_map_odom;
  bool localized = false;
  double score = 0.0;
  PoseReason reason = PoseReason::kWaiting;
  bool keyframe = false;     // True if the scan updated filter and map.
  bool scans_alone = false;  // Odometry would be used, but there was none that says anything. Not stored.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.stamp, self.T_map_robot, self.covariance, self.T_map_odom, self.localized, self.score, self.reason,
            self.keyframe);
    archive.Require(self.reason <= PoseReason::kWaiting, "the reason of a pose");
  }
};

// Whether odometry tells how a robot moves.
enum class MotionSource : std::uint8_t {
  kUsed,
  kNone,    // It sends none, or the options say that it is not used.
  kStands,  // It stands still although the last keyframes show that the robot moves: wheels that are not measured.
};

class Mapper {
 public:
  Mapper(const MapperOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed);
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  // `T_odom_robot` is the odometry at the scan's stamp. A scan whose pose is not localized is drawn into no
  // map, at least until its place is known.
  // `passage` is what lies between this scan and the one before it. Where that is a pause in which the scan does not
  // agree with the map, or is not known, the robot is not localized until it has been found in its map
  // (recovery/recovery.h); such scans are not in the snapshot unless they become keyframes. `rolling`: the same scan as
  // it was measured, if its beams were measured one after the other (tracking/scan_tracking.h). `odometry_rate`:
  // PairedScan::rate.
  ScanOutcome Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot, const ParallelFor& parallel_for,
                      Passage passage = Passage::kDriven, const RollingScan* rolling = nullptr,
                      const Pose2& odometry_rate = {});

  // Whether the next scans come with odometry (PairedScan::has_odometry). It is not part of the state.
  void ExpectOdometry(bool has_odometry);
  // Where odometry is not used, scans alone show the motion (ForScansAlone) until it is there, or moves, again.
  [[nodiscard]] MotionSource motion_source() const;

  // What was learned of the robot's odometry (tracking/odometry_learning.h), and the lag with which scans are to be
  // paired from now on (OdometryPairing::SetLag). Where scans alone show the motion, one of the names of
  // learned_value.h says so.
  [[nodiscard]] std::vector<LearnedValue> learned() const;
  [[nodiscard]] double learned_lag_s() const;

  // From now on `watch` is told when a step of Process begins. It is not part of the state: Load keeps it.
  void WatchSteps(StepWatch watch);

  // It has as many keyframes, or its map as many chunks, as the options allow: it takes no more scans.
  [[nodiscard]] bool full() const;

  [[nodiscard]] const OccupancyGrid& grid() const;
  // The whole grid, its changes since the last call, and the cells that keyframes have touched since then
  // (occupancy_grid.h: Share, TakeChange, TakeLooks).
  [[nodiscard]] OccupancyGrid::Chunks ShareGrid();
  [[nodiscard]] OccupancyGrid::Change TakeGridChange();
  [[nodiscard]] OccupancyGrid::Looks TakeGridLooks();
  [[nodiscard]] std::vector<Landmark> landmarks() const;  // The landmarks of the best hypothesis.
  // The poses of all hypotheses of the filter, with weights, where its estimate is `T_map_robot`. Only for a robot that
  // is localized in the map that it draws.
  [[nodiscard]] std::vector<WeightedPose> belief(const Pose2& T_map_robot) const;
  // The keyframes that are kept, and all that there have been.
  [[nodiscard]] std::size_t keyframe_count() const;
  [[nodiscard]] std::uint64_t keyframes_made() const;
  // All with smaller numbers are in the grid, and no other: fewer than have been made while a grid that was adopted is
  // still being continued.
  [[nodiscard]] std::uint64_t keyframes_drawn() const;
  // The numbers (trail/keyframe.h) of those that are kept, increasing.
  [[nodiscard]] std::vector<std::uint64_t> keyframe_numbers() const;
  // Those that are drawn into the grid (Keyframe::localized), by increasing number, and T_map_robot at which they are.
  // Empty while the robot's place in the map is not known.
  struct DrawnKeyframes {
    std::vector<std::uint64_t> numbers;
    std::vector<Pose2> path;
  };
  [[nodiscard]] DrawnKeyframes drawn_keyframes() const;
  // T_map_robot at which each kept keyframe is drawn, also of those that are not. Empty while the robot's place is not
  // known.
  [[nodiscard]] const std::vector<Pose2>& drawn_path() const;
  // Empty while the robot's place in the map is not known (filter.h: placed).
  [[nodiscard]] MapperSnapshot Snapshot() const;
  // Ends the mapping, when no scan will follow. Places that were seen again since the last large loop have corrected
  // the pose at once, but not the way to there: now the path is the one that fits them all best, as a smoothing job
  // would find it from this robot alone. Where few loops hold it, it stays (graph/pose_graph.h: HasFewLoops).
  // Pose and landmarks follow at once, and the map is drawn again along that path: DrawAgain draws some of it with each
  // call, a few milliseconds, and returns whether there is more.
  void SettlePath();
  bool DrawAgain();
  // Whether the map is being drawn again, for whatever reason. While scans come, they draw it.
  [[nodiscard]] bool draws_again() const;
  // Both to their end: up to a second for thousands of keyframes.
  void FinishMap();
  // Replaces the grid by the result of a finished job, drawn when there had been `keyframes` keyframes
  // (keyframes_made). `path` holds the poses of those with these `numbers` in it (none: 0, 1, 2, ...): path, particles,
  // landmarks and the pose follow, so that all agree with the grid. The later keyframes keep their places relative to
  // the last of these. If `path` lacks one of the earlier keyframes, or the filter can not follow (Filter::rebases),
  // only the grid is replaced. Then draws the later keyframes onto it along the present best path; where these are
  // many, some with every scan and every call of DrawLate; when this happens changes nothing but the grid until then.
  // Every chunk of both grids counts as changed. Where the grid knows of later keyframes than this mapper has made, or
  // where it is in another frame than this mapper's path (`must_follow`), it can only be used if the path follows; else
  // nothing is changed and the answer is false. `drawn`: the poses at which these keyframes are in the grid, if not at
  // `path`.
  bool AdoptGrid(OccupancyGrid grid, std::uint64_t keyframes, std::span<const Pose2> path = {},
                 std::span<const std::uint64_t> numbers = {}, bool must_follow = false,
                 std::span<const Pose2> drawn = {});
  // Draws some of the keyframes that a grid lacks which was adopted: a few milliseconds. Returns whether there are
  // more.
  bool DrawLate();
  [[nodiscard]] bool draws_late() const;
  // Whether the path can follow that of a job (Filter::rebases).
  [[nodiscard]] bool follows_paths() const;
  // Somebody says that the robot is not where it is believed to be, and perhaps where it is (T_map_robot at the last
  // scan). From the next scan on it is not localized until it is found in its map: near that pose, or anywhere
  // (recovery/recovery.h). Nothing happens before there is a map.
  void Relocalise(const std::optional<Pose2>& T_map_robot);
  // What a robot has seen whose place is not known, for a search elsewhere: the last scans that belong together, in the
  // order of time. If there are none since it was lost, the scan before. Empty where its place is known.
  struct LostView {
    bool lost = false;
    bool since_lost = false;  // The scans are those since it was lost.
    std::vector<RecentScan> scans;
    // Where somebody says that the robot is, carried by odometry to the last of the scans (Relocalise).
    std::optional<Pose2> T_map_said{};
  };
  [[nodiscard]] LostView SeenWhileLost() const;
  // A search in another map has found the robot: it was at `T_map_robot` when it saw the scan of this stamp. Its next
  // scans have to confirm that (Recovery::Suggest). False, and nothing is changed: the robot has been found or lost
  // anew meanwhile, has itself found another place, or is only localised and looks for itself in the map of its site.
  bool SuggestPlace(Stamp seen, const Pose2& T_map_robot, std::shared_ptr<const SearchedMap> map);
  // Such a place is not part of the saved state, because it comes with a map: who saves the state has to forget the
  // place, or to suggest it again here and after loading.
  [[nodiscard]] bool has_suggestion() const;
  void ForgetSuggestion();
  // Where a robot may be whose place is not known: places that were found and are not confirmed. Equal weights.
  [[nodiscard]] std::vector<WeightedPose> UnconfirmedPlaces() const;
  // From now on the robot is only localised in this map: what it has mapped itself stays as it is, and nothing is
  // added. `place_known`: its pose, or its start before the first scan, is one in this map; then it is looked for near
  // there, otherwise everywhere. A later call replaces the map, and the next scans must show that the robot is where it
  // was. Null: the robot maps again, from where it is, which must be known (FAILED_PRECONDITION).
  Result<void> LocaliseIn(std::shared_ptr<const KnownGrid> map, bool place_known);
  [[nodiscard]] bool localises() const;
  // The epoch of the map in which it is localised; nothing if it maps.
  [[nodiscard]] std::optional<std::uint32_t> known_map_epoch() const;
  // That map, null if it maps; and a copy of it that others use, too (KnownGrid::IsSameAs), in its place. A mapper
  // whose state was read has a map of its own.
  [[nodiscard]] std::shared_ptr<const KnownGrid> known_map() const;
  void ShareKnownMap(std::shared_ptr<const KnownGrid> same);
  // T_map_robot of every keyframe along the best path; empty while the robot's place in the map is not known.
  [[nodiscard]] std::vector<Pose2> BestPath() const;
  // The best path by stamps: where the robot was at the first of the scans that were seen from each keyframe. Empty
  // while its place in the map is not known.
  [[nodiscard]] Trajectory PathByStamps() const;
  // How many keyframes there had been when the past path changed last: by a large loop, or because the robot's place
  // became known. AdoptGrid does not count.
  [[nodiscard]] std::uint64_t path_changed_at() const;

  // Writes the whole state, and replaces it by one of a mapper with the same options (state/archive.h). If reading
  // fails, nothing changes.
  // First draws what an adopted grid still lacks (draws_late).
  void Save(StateWriter& archive) const;
  void Load(StateReader& archive);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn::slam
