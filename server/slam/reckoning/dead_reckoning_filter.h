// The filter `slam.filter: none`: the front-end's path without correction, with the uncertainty of its drift
// model. Landmarks are not used. A revisit corrects nothing, because the pose is not correlated with past
// poses; but several revisits in a row that the drift cannot explain mean that the pose is wrong, and
// health() reports it. Not thread-safe.
#pragma once

#include "server/slam/filters/back_end_options.h"
#include "server/slam/filters/contradictions.h"
#include "server/slam/filters/filter.h"
#include "server/slam/reckoning/reckoned_path.h"

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
  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.path_, self.contradictions_);
  }

 private:
  ReckonedPath path_;
  double max_nis_;
  Contradictions contradictions_;
};

}  // namespace cairn::slam
