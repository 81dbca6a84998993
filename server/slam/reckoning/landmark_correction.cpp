#include "server/slam/reckoning/landmark_correction.h"

#include "server/slam/landmarks/association.h"
#include "server/slam/landmarks/innovation.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, CorrectionOptions& options) {
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Way between the first sight of a landmark and a correction of the pose by it.");
}

LandmarkCorrection::LandmarkCorrection(const CorrectionOptions& options, const BackEndOptions& back_end,
                                       const Pose2& T_map_robot_start)
    : SinglePathFilter(back_end.drift, T_map_robot_start),
      options_(options),
      back_end_(back_end),
      candidates_(back_end.landmarks),
      contradictions_(back_end.diverged_after) {}

void LandmarkCorrection::Predict(const StepMotion& step) {
  path_.Advance(step.T_prev_curr, step.covariance_prev);
}

bool LandmarkCorrection::Observe(const RevisitObservation& revisit) {
  contradictions_.Add(path_.NisOf(revisit) < kMaxNis<3>);
  return false;
}

void LandmarkCorrection::Observe(const KeyframeSight& sight, const ParallelFor& /*parallel_for*/) {
  Observe(candidates_.Observe(sight.view.features, sight.T_track_robot, sight.travelled_m), sight.travelled_m);
}

void LandmarkCorrection::Observe(const std::vector<LandmarkSighting>& sightings, double travelled_m) {
  std::vector<Found> found;
  std::vector<LandmarkSighting> fresh;
  const Pose2& T_map_robot = path_.T_map_robot();
  for (const LandmarkSighting& sighting : sightings) {
    const Eigen::Vector2d p_map = T_map_robot * sighting.p_robot;
    AssociationVote vote;
    for (std::size_t m = 0; m < memory_.size(); ++m) {
      const Memory& old = memory_[m];
      if (!Alike(old.signature, sighting.signature, back_end_.landmarks)) continue;
      if ((old.p_map - p_map).norm() > kMatchDistanceM) continue;
      if (!SlopesAgree(sighting, T_map_robot.theta, old.slope_map, old.signature, back_end_.landmarks)) continue;
      vote.Add(m, Likeness::kMatch, travelled_m - old.last_used_m < options_.min_travel_m);
    }
    const Association association = vote.result();
    if (association.decision == AssociationDecision::kNew) fresh.push_back(sighting);
    if (association.decision != AssociationDecision::kKnown) continue;
    found.push_back({sighting, association.slot});
    memory_[association.slot].last_used_m = travelled_m;
    ++memory_[association.slot].sightings;
  }
  if (!found.empty()) Correct(found);
  for (const LandmarkSighting& sighting : fresh)
    memory_.push_back({sighting.slot, sighting.signature, T_map_robot * sighting.p_robot,
                       WrapAngle(T_map_robot.theta + sighting.slope), path_.covariance(), travelled_m, 1});
}

void LandmarkCorrection::Correct(const std::vector<Found>& found) {
  Pose2 pose = path_.T_map_robot();
  Eigen::Matrix3d covariance = path_.covariance();
  const LandmarkNoise& noise = back_end_.landmarks.noise;
  const double count = static_cast<double>(found.size());
  Eigen::Matrix3d first = Eigen::Matrix3d::Zero();  // Mean covariance of the pose at the first sightings.
  double turn = 0.0;
  for (const Found& f : found) {
    turn += AngleDiff(memory_[f.memory].slope_map, pose.theta + f.sighting.slope) / count;
    first += memory_[f.memory].covariance / count;
  }
  // Both sightings, the first and the present one, have the landmark noise.
  const double turn_variance = first(2, 2) + 2.0 * noise.slope_rad * noise.slope_rad / count;
  bool plausible = turn * turn < kMaxNis<1> * (covariance(2, 2) + turn_variance);
  if (plausible && turn_variance < covariance(2, 2)) {
    pose.theta = WrapAngle(pose.theta + turn);
    covariance.row(2).setZero();
    covariance.col(2).setZero();
    covariance(2, 2) = turn_variance;
  }

  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  double corners = 0.0, range2 = 0.0;
  for (const Found& f : found) {
    if (!f.sighting.signature.corner) continue;
    shift += memory_[f.memory].p_map - pose * f.sighting.p_robot;
    range2 += f.sighting.p_robot.squaredNorm();
    corners += 1.0;
  }
  if (plausible && corners > 0.0) {
    shift /= corners;
    range2 /= corners;
    // An error of the heading moves the corners sideways.
    const double sideways = noise.bearing_rad * noise.bearing_rad / corners + 0.5 * covariance(2, 2);
    const double measured = 2.0 * (noise.range_m * noise.range_m / corners + sideways * range2);
    const Eigen::Matrix2d shift_covariance = first.topLeftCorner<2, 2>() + measured * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d before = covariance.topLeftCorner<2, 2>();
    plausible = Nis<2>(shift, before + shift_covariance) < kMaxNis<2>;
    if (plausible && shift_covariance.trace() < before.trace()) {
      pose.x += shift.x();
      pose.y += shift.y();
      covariance.topLeftCorner<2, 2>() = shift_covariance;
      covariance.block<2, 1>(0, 2).setZero();
      covariance.block<1, 2>(2, 0).setZero();
    }
  }
  contradictions_.Add(plausible);
  if (plausible) path_.Correct(pose, covariance);
}

std::vector<Landmark> LandmarkCorrection::landmarks() const {
  std::vector<Landmark> landmarks;
  const LandmarkNoise& noise = back_end_.landmarks.noise;
  for (const Memory& old : memory_)
    landmarks.push_back(
        {old.slot, old.signature.corner, old.p_map, old.slope_map,
         old.covariance.topLeftCorner<2, 2>() + noise.range_m * noise.range_m * Eigen::Matrix2d::Identity(),
         old.sightings});
  return landmarks;
}

}  // namespace cairn::slam
