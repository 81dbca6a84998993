// What every back-end filter is to the mapper: the matched motion and the keyframe's evidence go in, an estimate of the
// pose, the path and the landmarks comes out. One step is Predict (not before the first keyframe), then any number of
// Observe, then Commit.
// Frames: poses are T_map_robot. Not thread-safe; deterministic for a seed, on any number of threads.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/filters/shared_sequence.h"
#include "server/slam/landmark.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

// The robot seen from keyframe `keyframe`, by scan matching.
struct RevisitObservation {
  std::size_t keyframe = 0;
  Pose2 T_keyframe_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

// What a keyframe shows: landmark filters use the features, grid filters the ranges.
struct KeyframeSight {
  const Scan& scan;
  const ScanView& view;
  Pose2 T_track_robot;       // The front-end's pose of it.
  double travelled_m = 0.0;  // Along the path so far.
};

// A belief about path and pose, shared with the filter: cheap to copy.
struct Hypothesis {
  Pose2 T_map_robot;
  SharedSequence<Pose2> path;  // T_map_robot at every keyframe committed.
};

struct FilterEstimate {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // (x, y, theta) in map.
};

// For the consistency study and for saying "lost".
struct FilterHealth {
  double effective_sample_size = 1.0;  // 1 for filters with one hypothesis.
  double nis = 0.0;       // Sum of squared Mahalanobis innovations of the last step, over the whole belief ...
  int nis_dimension = 0;  // ... and of how many numbers.
  bool diverged = false;  // The filter knows that its estimate means nothing any more.
};

class Filter {
 public:
  virtual ~Filter() = default;

  virtual void Predict(const StepMotion& step) = 0;
  // False where it explains nothing or the filter has no use for revisits: nothing changes.
  virtual bool Observe(const RevisitObservation& revisit) = 0;
  virtual void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) = 0;
  // Ends the step: the pose joins the path.
  virtual void Commit() = 0;
  // Whether Rebase does anything.
  [[nodiscard]] virtual bool rebases() const { return false; }
  // Between steps: a large loop showed that the way went like this, one pose per keyframe committed. Every hypothesis
  // takes it, and what it saw moves with the keyframes it was seen from. False where the filter cannot.
  virtual bool Rebase(std::span<const Pose2> /*path*/) { return false; }

  // False: where in `map` the robot is nobody knows yet; its poses are relative to wherever it started. When it is
  // first placed, the whole path moves.
  [[nodiscard]] virtual bool placed() const { return true; }
  [[nodiscard]] virtual FilterEstimate estimate() const = 0;
  [[nodiscard]] virtual FilterHealth health() const = 0;
  // Hypothesis 0 is the best one; the others stand for the spread of the belief.
  [[nodiscard]] virtual std::size_t hypothesis_count() const = 0;
  [[nodiscard]] virtual Hypothesis hypothesis(std::size_t index) const = 0;
  [[nodiscard]] virtual std::vector<Landmark> landmarks() const = 0;  // Of the best hypothesis.
};

}  // namespace cairn::slam
