// The part of the mapper that corrects odometry by what it has learned of it.
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/slam/mapper_state.h"

namespace cairn::slam {

ScanOutcome Mapper::Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot,
                            const ParallelFor& parallel_for, Passage passage, const RollingScan* rolling,
                            const Pose2& odometry_rate) {
  State& s = *state_;
  const bool driven = passage != Passage::kUnknown && passage != Passage::kOdometryBegan;
  const Pose2 used = s.learning.Corrected(T_odom_robot, driven, odometry_rate);
  RollingScan corrected;
  if (rolling != nullptr && s.learning.corrects()) {
    corrected = {rolling->scan, s.learning.Corrected(rolling->odometry)};
    rolling = &corrected;
  }
  passage = s.ChooseOdometry(passage, *scan, used);
  const bool odometry_begins = passage == Passage::kOdometryBegan;
  ScanOutcome outcome = s.Process(std::move(scan), used, parallel_for, odometry_begins ? Passage::kDriven : passage,
                                  rolling, odometry_begins);
  outcome.scans_alone = s.configured.front_end.use_odometry && !s.options.front_end.use_odometry;
  if (odometry_begins) s.UseOdometry(true);
  // Robots join the map with their odometry as they have it.
  if (s.learning.corrects()) outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
  return outcome;
}

std::vector<LearnedValue> Mapper::learned() const {
  std::vector<LearnedValue> values = state_->learning.values();
  const MotionSource use = state_->UseOfOdometry();
  if (use == MotionSource::kUsed || !state_->configured.front_end.use_odometry) return values;
  const std::string_view name = use == MotionSource::kNone ? kLearnedNoOdometry : kLearnedOdometryStands;
  values.push_back({.name = std::string(name), .unit = "1", .value = 1.0, .applied = true});
  return values;
}

double Mapper::learned_lag_s() const {
  return state_->learning.lag_s();
}

}  // namespace cairn::slam
