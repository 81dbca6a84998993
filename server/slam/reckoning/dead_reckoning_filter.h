// The filter `slam.filter: none`: the front-end's path without correction, with the uncertainty of its drift
// model. Landmarks are not used. A revisit corrects nothing, because the pose is not correlated with past
// poses; but several revisits in a row that the drift cannot explain mean that the pose is wrong, and
// health() reports it. Not thread-safe.
#pragma once

#include <Eigen/Core>

#include "server/slam/filters/filter.h"
#include "server/slam/filters/filter_health.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/trail/pose_path.h"

namespace cairn::slam {

// A path that only adds up the steps it is given, with its uncertainty. The filters that do not estimate past
// poses use it. Poses in `map`, covariances of (x, y, theta). Not thread-safe.
class ReckonedPath {
 public:
  ReckonedPath(const MotionNoise& drift, const Pose2& T_map_robot_start) : drift_(drift), pose_(T_map_robot_start) {}

  void Advance(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  void Keep() { path_.Append(pose_); }
  // Replaces the present pose and its covariance; past poses are unchanged.
  void Correct(const Pose2& T_map_robot, const Eigen::Matrix3d& covariance) {
    pose_ = T_map_robot;
    covariance_ = covariance;
  }
  // Moves the whole path rigidly so that the present pose becomes this one.
  void MoveTo(const Pose2& T_map_robot);

  // Squared Mahalanobis distance (three degrees of freedom) of a revisit from the steps since that keyframe.
  // Changes nothing. Time is linear in the number of keyframes since.
  [[nodiscard]] double NisOf(const RevisitObservation& revisit) const;

  [[nodiscard]] const Pose2& T_map_robot() const { return pose_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance() const { return covariance_; }
  [[nodiscard]] const PosePath& path() const { return path_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.pose_, self.covariance_, self.path_);
  }

 private:
  MotionNoise drift_;
  Pose2 pose_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  PosePath path_;
};

// A filter whose belief is one path, which continues with every step.
class SinglePathFilter : public Filter {
 public:
  void Commit() override { path_.Keep(); }
  [[nodiscard]] FilterEstimate estimate() const override { return {path_.T_map_robot(), path_.covariance()}; }
  [[nodiscard]] std::size_t hypothesis_count() const override { return 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t /*index*/) const override {
    return {path_.T_map_robot(), path_.path()};
  }
  [[nodiscard]] std::vector<Landmark> landmarks() const override { return {}; }

 protected:
  SinglePathFilter(const MotionNoise& drift, const Pose2& T_map_robot_start) : path_(drift, T_map_robot_start) {}

  ReckonedPath path_;
};

class DeadReckoningFilter final : public SinglePathFilter {
 public:
  DeadReckoningFilter(const BackEndOptions& options, const Pose2& T_map_robot_start)
      : SinglePathFilter(options.drift, T_map_robot_start), contradictions_(options.diverged_after) {}

  void Predict(const StepMotion& step) override { path_.Advance(step.T_prev_curr, step.covariance_prev); }
  bool Observe(const RevisitObservation& revisit) override {
    contradictions_.Add(path_.NisOf(revisit) < kMaxNis<3>);
    return false;
  }
  void Observe(const KeyframeSight& /*sight*/, const ParallelFor& /*parallel_for*/) override {}

  [[nodiscard]] FilterHealth health() const override { return {1.0, 0.0, 0, contradictions_.diverged()}; }
  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.path_, self.contradictions_);
  }

 private:
  Contradictions contradictions_;
};

}  // namespace cairn::slam
