// The part of the mapper that corrects odometry by what it has learned of it.
#include <utility>

#include "server/slam/mapper_state.h"

namespace cairn::slam {

ScanOutcome Mapper::Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot,
                            const ParallelFor& parallel_for, Passage passage, const RollingScan* rolling,
                            const Pose2& odometry_rate) {
  State& s = *state_;
  const bool driven = passage != Passage::kUnknown;
  const Pose2 used = s.learning.Corrected(T_odom_robot, driven, odometry_rate);
  RollingScan corrected;
  if (rolling != nullptr && s.learning.corrects()) {
    corrected = {rolling->scan, s.learning.Corrected(rolling->odometry)};
    rolling = &corrected;
  }
  ScanOutcome outcome = s.Process(std::move(scan), used, parallel_for, passage, rolling);
  // Robots join the map with their odometry as they have it.
  if (s.learning.corrects()) outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
  return outcome;
}

std::vector<LearnedValue> Mapper::learned() const {
  return state_->learning.values();
}

double Mapper::learned_lag_s() const {
  return state_->learning.lag_s();
}

}  // namespace cairn::slam
