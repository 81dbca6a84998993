// The keyframes along the way of one robot: the keyframes themselves, their shapes, the relations between
// them (the motion from each keyframe to the next, and the relative poses of keyframes whose place was seen
// again: loops), the distances along these relations, which bound the error of two keyframes' relative pose,
// and the places of the scans between them. It is the only owner of all this; searches and checks read it. It
// does not contain the poses of the keyframes in the map: these are the filter's path. Not thread-safe.
// Source: Lu and Milios 1997; distance along the graph as a measure of uncertainty: Bosse et al. 2004 (Atlas).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/slam/graph/pose_graph.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/scan/surface_points.h"
#include "server/slam/state/frozen_blocks.h"
#include "server/slam/trail/keyframe.h"
#include "server/slam/trail/point_cache.h"
#include "server/slam/trail/retirement.h"
#include "server/slam/trail/way_bounds.h"

namespace cairn::slam {

// How well the relations of Trail::SetShape are known: more certain than the steps over the way between two of them, so
// that those do not pull it back.
inline constexpr double kShapeSigmaM = 0.02;
inline constexpr double kShapeSigmaRad = 0.002;
// Whether a relation is one of Trail::SetShape. It is told by its covariance, which no measured relation has, so that
// checkpoints of all formats say it.
[[nodiscard]] bool KeepsShape(const PoseRelation& relation);

class Trail {
 public:
  // `drift` gives the covariance of a matched step; `surface` are the options with which the points were found.
  explicit Trail(const MotionNoise& drift, const SurfaceOptions& surface = {}) : drift_(drift), surface_(surface) {}

  // Appends the next keyframe. `step_covariance` is the covariance of the step to it, in the frame in which
  // the step starts, in addition to the drift; it is ignored for the first keyframe. `revisit` is an old
  // keyframe that was seen again from this one. `points_robot` are the surface points of its scan; nothing: they are
  // found when somebody looks at them.
  void Append(Keyframe keyframe, const Pose2& T_track_robot, std::optional<std::vector<SurfacePoint>> points_robot,
              const Eigen::Matrix3d& step_covariance, const std::optional<RevisitObservation>& revisit);
  // Sets whether the last keyframe is localized, so that it may be drawn, and if not, whether its place along the path
  // is known (Keyframe::tentative). REQUIRES: not empty.
  void MarkLast(bool localized, bool on_the_path);
  // The path has been corrected: tentative keyframes count as localized.
  void ConfirmTentative();
  // The keyframes as they would be after ConfirmTentative.
  [[nodiscard]] std::vector<Keyframe> ConfirmedKeyframes() const;
  // Of so many scans at least the places are kept; of earlier ones only those that are keyframes.
  static constexpr std::size_t kMostScans = 1 << 17;  // 5 MiB.
  // Appends a scan with its pose relative to the last keyframe. REQUIRES: not empty.
  void AddScan(Stamp stamp, const Pose2& T_keyframe_robot);
  // Adds a large loop that was used to correct the path.
  void AddLoop(const PoseRelation& loop);
  // The path that fits all relations and `loop` best; the search starts at `path` (one pose per keyframe).
  // Nothing if the result is not usable, or if the other relations contradict the loop, which is then most likely
  // wrong. The loop is not added to the relations.
  [[nodiscard]] std::optional<std::vector<Pose2>> PathWithLoop(const PoseRelation& loop, std::vector<Pose2> path,
                                                               const PoseGraphOptions& options) const;

  [[nodiscard]] bool empty() const { return keyframes_.empty(); }
  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }
  // A pose in the front-end's frame relative to the last keyframe; the identity before the first keyframe.
  [[nodiscard]] Pose2 FromLast(const Pose2& T_track_robot) const;
  // The distance that the robot has travelled when it is at this pose in the front-end's frame.
  [[nodiscard]] double TravelledTo(const Pose2& T_track_robot) const;

  [[nodiscard]] const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] std::span<const KeyframeShape> shapes() const { return shapes_; }
  // The surface points of a keyframe in its robot frame. They are computed from its scan unless the keyframe was looked
  // at lately (point_cache.h).
  [[nodiscard]] SharedPoints points(std::size_t keyframe) const;
  // Per keyframe: length of the shortest path along the relations from the last keyframe, in metres. The first call
  // after a change goes through all keyframes; IsFarther seldom does, and AllWithin never.
  [[nodiscard]] std::span<const double> distances_m() const;
  // Whether distances_m()[keyframe] is more than `way_m`.
  [[nodiscard]] bool IsFarther(std::size_t keyframe, double way_m) const;
  // Whether IsFarther is false for all keyframes from `begin` on and before `end`. It may say no although it is; for
  // the keyframes below a node of a path (shared_sequence.h) it takes no longer than for one.
  [[nodiscard]] bool AllWithin(std::size_t begin, std::size_t end, double way_m) const;
  [[nodiscard]] const std::vector<MapperSnapshot::ScanPlace>& scans() const { return scans_; }
  // How many of the keyframes on the last `way_m` metres, before the robot has travelled `travelled_m`, have seen an
  // older one again.
  [[nodiscard]] std::size_t RevisitsWithin(double way_m, double travelled_m) const;
  // The shape of a path that a job has found, along which it knew more than this trail: relations that keep it when the
  // path is fitted again, in place of those of the job before. They are no measurements (KeepsShape).
  void SetShape(const std::vector<PoseRelation>& shape);
  // Steps, revisits, loops, and the relations of SetShape; empty as long as there are only steps.
  [[nodiscard]] std::vector<PoseRelation> relations() const;
  // The same without those of SetShape: what was measured. Empty as long as no place was seen again.
  [[nodiscard]] std::vector<PoseRelation> measured() const;
  // The steps alone, if a shape was set and no place was seen again; else nothing.
  [[nodiscard]] std::vector<PoseRelation> steps_of_shaped() const;
  // How many keyframes there have been, with those that were retired.
  [[nodiscard]] std::uint64_t made() const { return empty() ? 0 : shapes_.back().number + 1; }
  [[nodiscard]] std::vector<std::uint64_t> numbers() const;  // Of the keyframes.
  // How many of the keyframes have a smaller number.
  [[nodiscard]] std::size_t CountBelow(std::uint64_t number) const;
  // Gives up keyframes. What they knew is handed over to their representatives: their relations, as far as they are
  // not repetitions, and the scans seen from them. REQUIRES: the last keyframe stays.
  void Retire(const Retirement& retirement);

  // Without the points, the loops and the distances, which follow from the rest.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    InBlocks(archive, self.frozen_keyframes_, self.keyframes_);
    InBlocks(archive, self.frozen_shapes_, self.shapes_);
    InBlocks(archive, self.frozen_relations_, self.relations_);
    InBlocks(archive, self.frozen_scans_, self.scans_);
    const std::size_t size = self.size();
    archive.SetKeyframes(size);
    if constexpr (Archive::kReads)
      if (archive.RequireThat([&] { return self.IsConsistent(); }, "the way along the keyframes")) self.RestoreRest();
  }

 private:
  struct Loop {
    std::size_t other = 0;
    double way_m = 0.0;
  };
  [[nodiscard]] std::vector<double> DistancesFromLast() const;
  // At least distances_m()[keyframe], from what is known already.
  [[nodiscard]] double DistanceAtMost(std::size_t keyframe) const;
  void NoteLoop(const PoseRelation& loop);
  // Whether what was read fits together.
  [[nodiscard]] bool IsConsistent() const;
  void RestoreRest();
  void DropOldScans();

  static constexpr std::size_t kMaxCachedPoints = 1 << 18;  // 8 MiB.

  MotionNoise drift_;
  SurfaceOptions surface_;
  std::vector<Keyframe> keyframes_;
  std::vector<KeyframeShape> shapes_;  // One per keyframe.
  mutable PointCache points_{kMaxCachedPoints};
  std::vector<PoseRelation> relations_;
  std::vector<std::vector<Loop>> loops_;  // One list per keyframe. A loop is stored at both of its keyframes.
  mutable std::vector<double> distances_m_;
  mutable WayBounds way_bounds_;  // Follows from the rest.
  mutable bool distances_current_ = true;
  std::vector<MapperSnapshot::ScanPlace> scans_;
  // For checkpoints: all of these grow at their ends only, but for the keyframes in ConfirmTentative, the relations in
  // SetShape, the scans in DropOldScans, and in Retire.
  FrozenBlocks<Keyframe> frozen_keyframes_;
  FrozenBlocks<KeyframeShape> frozen_shapes_;
  FrozenBlocks<PoseRelation> frozen_relations_;
  FrozenBlocks<MapperSnapshot::ScanPlace> frozen_scans_;
};

}  // namespace cairn::slam
