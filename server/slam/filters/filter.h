// The interface of every back-end filter. Its input is the matched motion and the observations at a keyframe;
// its output is an estimate of the pose, the path and the landmarks. One step is Predict (not before the
// first keyframe), then any number of calls of Observe, then Commit.
// Frames: poses are T_map_robot. Not thread-safe. Deterministic for a given seed, with any number of threads.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/features/scan_view.h"
#include "server/slam/landmarks/landmark.h"
#include "server/slam/landmarks/landmark_options.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/parallel_for.h"
#include "server/slam/state/archive.h"
#include "server/slam/trail/keyframe.h"
#include "server/slam/trail/pose_path.h"
#include "server/slam/trail/retirement.h"

namespace cairn::slam {

// Largest squared Mahalanobis distance that an observation of N numbers may count for: for every N the chi-square
// quantile of the same share of true observations, 99.89 %. With a larger value contradicting observations raise the
// doubt about the pose further. Half or twice the value changes no error (study `sensitivity`).
template <int N>
inline constexpr double kMaxNis = [] {
  static_assert(1 <= N && N <= 3);
  return N == 1 ? 10.5949 : N == 2 ? 13.5640 : 16.0;
}();

// Options that all filters of the mapper share: the drift of the motion that they receive, landmarks, and
// when a filter counts as diverged.
struct BackEndOptions {
  MotionNoise drift{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005};
  LandmarkOptions landmarks;
  std::int64_t diverged_after = 10;
};

// The content of a keyframe: filters with landmarks use the features, filters with grids the ranges.
struct KeyframeSight {
  const Scan& scan;
  const ScanView& view;
  Pose2 T_track_robot;       // Pose of the keyframe in the front-end's frame.
  double travelled_m = 0.0;  // Distance travelled along the path so far.
};

// One hypothesis of the filter: a pose and a path. The path is shared with the filter, so that a copy is
// cheap.
struct Hypothesis {
  Pose2 T_map_robot;
  PosePath path;  // T_map_robot at every committed keyframe.
};

// A pose of the robot and its share of the belief, 0..1.
struct WeightedPose {
  Pose2 T_map_robot;
  double weight = 0.0;
};

struct FilterEstimate {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // Covariance of (x, y, theta) in map.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_robot, self.covariance);
  }
};

// Indicators for the consistency study, and for reporting that the robot is lost.
struct FilterHealth {
  double effective_sample_size = 1.0;  // 1 for filters with one hypothesis.
  // Sum of the squared Mahalanobis distances of the last step's innovations, over all hypotheses.
  double nis = 0.0;
  int nis_dimension = 0;  // Degrees of freedom of `nis`.
  bool diverged = false;  // The estimate of the filter is no longer usable.
};

class Filter {
 public:
  virtual ~Filter() = default;

  virtual void Predict(const StepMotion& step) = 0;
  // Instead of Predict, for a robot whose way from the last keyframe nobody knows, and that was found in the map of
  // others: every hypothesis goes on at this pose of `map`, wherever it has the places that the robot has seen before.
  // False, and nothing changes: the filter needs a step.
  virtual bool GoOnAt(const FilterEstimate& /*place*/) { return false; }
  // Uses a revisit. False if the filter cannot explain it or does not use revisits; then nothing changes.
  virtual bool Observe(const RevisitObservation& revisit) = 0;
  virtual void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) = 0;
  // Ends the step and appends the pose to the path.
  virtual void Commit() = 0;
  // True if the filter supports Rebase and MoveTo.
  [[nodiscard]] virtual bool rebases() const { return false; }
  // Replaces the path after a large loop was closed; `path` has one pose per committed keyframe. Every
  // hypothesis takes this path, and its landmarks move with the keyframes from which they were seen.
  // REQUIRES: rebases(), and called between steps.
  virtual void Rebase(std::span<const Pose2> /*path*/) {}
  // After Rebase: the large loop that `path` follows has measured the last keyframe from an old one. For filters whose
  // doubt Rebase does not replace. REQUIRES: rebases(), and called between steps.
  virtual void LearnLoop(const RevisitObservation& /*loop*/) {}
  // Moves the path of hypothesis 0 to `path`, which has one pose per committed keyframe, and all that is believed with
  // it: at each keyframe the other hypotheses and what was seen from it keep their places relative to hypothesis 0. In
  // contrast to Rebase no doubt is removed: what a job has found out from other robots moves the path, but does not
  // make the filter surer of it, and what the filter has found out since is not lost. REQUIRES: rebases(), and called
  // between steps.
  virtual void MoveTo(std::span<const Pose2> /*path*/) {}
  // True if the filter supports Retire.
  [[nodiscard]] virtual bool retires() const { return false; }
  // Gives up committed keyframes: the paths go on without them, and what was seen from them counts as seen from their
  // representatives. REQUIRES: retires(), and called between steps.
  virtual void Retire(const Retirement& /*retirement*/) {}

  // False as long as the pose of the robot in `map` is not known; its poses are then relative to its start.
  // When the robot is placed for the first time, the whole path moves.
  [[nodiscard]] virtual bool placed() const { return true; }
  [[nodiscard]] virtual FilterEstimate estimate() const = 0;
  [[nodiscard]] virtual FilterHealth health() const = 0;
  // Hypothesis 0 is the best one; the others represent the spread of the belief.
  [[nodiscard]] virtual std::size_t hypothesis_count() const = 0;
  [[nodiscard]] virtual Hypothesis hypothesis(std::size_t index) const = 0;
  // The poses of all hypotheses with their weights, whose sum is 1.
  [[nodiscard]] virtual std::vector<WeightedPose> belief() const { return {{estimate().T_map_robot, 1.0}}; }
  [[nodiscard]] virtual std::vector<Landmark> landmarks() const = 0;  // Landmarks of the best hypothesis.

  // Writes the whole state, and replaces it (state/archive.h). REQUIRES: called between steps. If reading fails, the
  // filter must not be used any more.
  virtual void Save(StateWriter& archive) const = 0;
  virtual void Load(StateReader& archive) = 0;
};

}  // namespace cairn::slam
