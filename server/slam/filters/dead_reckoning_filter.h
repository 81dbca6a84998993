// No filter: the front-end's path as it is, with the uncertainty its drift model gives. Has no use for landmarks. A
// revisit corrects nothing, since nothing ties the pose to its past; but several in a row that the drift can not
// explain mean that the pose is wrong, and it says so. `slam.filter: none`. Not thread-safe.
#pragma once

#include "server/slam/filters/back_end_options.h"
#include "server/slam/filters/contradictions.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/reckoned_path.h"

namespace cairn::slam {

class DeadReckoningFilter final : public Filter {
 public:
  DeadReckoningFilter(const BackEndOptions& options, const Pose2& T_map_robot_start)
      : path_(options.drift, T_map_robot_start), max_nis_(options.max_nis), contradictions_(options.diverged_after) {}

  void Predict(const StepMotion& step) override { path_.Advance(step.T_prev_curr, step.covariance_prev); }
  bool Observe(const RevisitObservation& revisit) override {
    contradictions_.Add(path_.NisOf(revisit) < max_nis_);
    return false;
  }
  void Observe(const KeyframeSight& /*sight*/, const ParallelFor& /*parallel_for*/) override {}
  void Commit() override { path_.Keep(); }

  [[nodiscard]] FilterEstimate estimate() const override { return {path_.T_map_robot(), path_.covariance()}; }
  [[nodiscard]] FilterHealth health() const override { return {1.0, 0.0, 0, contradictions_.diverged()}; }
  [[nodiscard]] std::size_t hypothesis_count() const override { return 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t /*index*/) const override {
    return {path_.T_map_robot(), path_.path()};
  }
  [[nodiscard]] std::vector<Landmark> landmarks() const override { return {}; }

 private:
  ReckonedPath path_;
  double max_nis_;
  Contradictions contradictions_;
};

}  // namespace cairn::slam
