#include "server/slam/ekf/ekf_slam.h"

#include <algorithm>
#include <utility>

#include "server/slam/filters/revisit_innovation.h"
#include "server/slam/landmark_variants/landmark_point.h"
#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, EkfOptions& options) {
  visitor.Integer("max_landmarks", options.max_landmarks, "1", 1, 5000,
                  "Most landmarks. When there are more, the one seen least often is removed. Time and memory grow with "
                  "the square.");
  visitor.Integer("max_anchors", options.max_anchors, "1", 1, 5000,
                  "Most old poses that are kept in the state. When all are used, later keyframes are related to the "
                  "last one, with growing uncertainty.");
  visitor.Real("anchor_distance_m", options.anchor_distance_m, "m", 0.1, 1000.0,
               "Way between two old poses that are kept. Smaller values close loops better and take more time.");
}

EkfSlam::EkfSlam(const EkfOptions& options, const BackEndOptions& back_end, const Pose2& T_map_robot_start)
    : options_(options),
      back_end_(back_end),
      gate_(ChiSquareQuantile(back_end.landmarks.match_share, LandmarkPoint::kGateNumbers)),
      candidates_(back_end.landmarks),
      state_(T_map_robot_start),
      contradictions_(back_end.diverged_after) {}

void EkfSlam::Predict(const StepMotion& step) {
  const Eigen::Matrix3d step_covariance = back_end_.drift.Covariance(step.T_prev_curr) + step.covariance_prev;
  state_.Move(step.T_prev_curr, step_covariance);
  DeadReckon(since_anchor_.T_anchor_robot, since_anchor_.covariance, step.T_prev_curr, step_covariance);
  since_anchor_m_ += step.T_prev_curr.translation().norm();
}

EkfSlam::SeenFromAnchor EkfSlam::SeeFromAnchor(const RevisitObservation& revisit) const {
  const Hung& hung = keyframes_[revisit.keyframe];
  const Eigen::Index at = anchors_[hung.anchor].at;
  const Pose2 T_map_anchor = state_.pose(at), T_map_robot = state_.robot();
  const Pose2 T_map_keyframe = T_map_anchor * hung.T_anchor_robot;
  const Eigen::Matrix3d J_z_keyframe =
      J_compose_left(T_map_keyframe.Inverse(), T_map_robot) * J_inverse(T_map_keyframe);
  const Eigen::Matrix3d J_z_hung = J_z_keyframe * J_compose_right(T_map_anchor, hung.T_anchor_robot);
  return {InnovateRevisit(T_map_keyframe, T_map_robot, revisit), at,
          J_z_keyframe * J_compose_left(T_map_anchor, hung.T_anchor_robot),
          revisit.covariance + J_z_hung * hung.covariance * J_z_hung.transpose()};
}

bool EkfSlam::Observe(const RevisitObservation& revisit) {
  const SeenFromAnchor seen = SeeFromAnchor(revisit);
  const Innovation<3>& innovation = seen.innovation;
  const double nis =
      Nis<3>(innovation.v, state_.InnovationCovariance<3, 3>(innovation.J_z_pose, seen.at, seen.J_z_anchor, seen.R));
  const bool explained = nis < kMaxNis<3>;
  contradictions_.Add(explained);
  if (!explained) return false;
  nis_.Add(nis, 3);
  state_.Update<3, 3>(innovation.v, innovation.J_z_pose, seen.at, seen.J_z_anchor, seen.R);
  moved_path_ = true;
  return true;
}

void EkfSlam::Observe(const KeyframeSight& sight, const ParallelFor& /*parallel_for*/) {
  Observe(candidates_.Observe(sight.view.features, sight.T_track_robot, sight.travelled_m), sight.travelled_m);
}

void EkfSlam::Observe(const std::vector<LandmarkSighting>& sightings, double travelled_m) {
  std::vector<LandmarkSighting> fresh;
  for (const LandmarkSighting& sighting : sightings) {
    const Association association = Associate(sighting, travelled_m);
    if (association.decision == AssociationDecision::kNew) fresh.push_back(sighting);
    if (association.decision != AssociationDecision::kKnown) continue;
    Entry& entry = landmarks_[association.slot];
    const auto measured = LandmarkPoint::Measure(sighting, back_end_.landmarks.noise);
    const RangeBearing expected = PredictRangeBearing(state_.robot(), state_.point(entry.at));
    Eigen::Vector2d v = measured.z - expected.z;
    v.y() = WrapAngle(v.y());
    nis_.Add(
        Nis<2>(v, state_.InnovationCovariance<2, 2>(expected.J_z_pose, entry.at, expected.J_z_point, measured.R_z)), 2);
    state_.Update<2, 2>(v, expected.J_z_pose, entry.at, expected.J_z_point, measured.R_z);
    moved_path_ = true;
    entry.last_observed_m = travelled_m;
    ++entry.sightings;
  }
  for (const LandmarkSighting& sighting : fresh) AddLandmark(sighting, travelled_m);
}

bool EkfSlam::IsConsistent(std::size_t keyframes) const {
  bool sound = keyframes_.size() == keyframes && (keyframes == 0 || since_anchor_.anchor < anchors_.size());
  for (const Entry& entry : landmarks_)
    sound = sound && 3 <= entry.at && entry.at + 2 <= state_.size() && entry.first_keyframe < keyframes;
  for (const Anchor& anchor : anchors_)
    sound = sound && 3 <= anchor.at && anchor.at + 3 <= state_.size() && anchor.keyframe < keyframes;
  for (const Hung& hung : keyframes_) sound = sound && hung.anchor < anchors_.size();
  return sound;
}

Association EkfSlam::Associate(const LandmarkSighting& sighting, double travelled_m) const {
  const LandmarkOptions& options = back_end_.landmarks;
  const Pose2 T_map_robot = state_.robot();
  const Eigen::Vector2d p_map = T_map_robot * sighting.p_robot;
  const auto measured = LandmarkPoint::Measure(sighting, options.noise);
  AssociationVote vote;
  for (std::size_t l = 0; l < landmarks_.size(); ++l) {
    const Entry& entry = landmarks_[l];
    if (!Alike(entry.signature, sighting.signature, options)) continue;
    if ((state_.point(entry.at) - p_map).norm() > kMatchDistanceM) continue;
    if (!SlopesAgree(sighting, T_map_robot.theta, entry.slope_map, entry.signature, options)) continue;
    const RangeBearing expected = PredictRangeBearing(T_map_robot, state_.point(entry.at));
    Eigen::Vector2d v = measured.z - expected.z;
    v.y() = WrapAngle(v.y());
    const double nis =
        Nis<2>(v, state_.InnovationCovariance<2, 2>(expected.J_z_pose, entry.at, expected.J_z_point, measured.R_z));
    vote.Add(l, nis < gate_ ? Likeness::kMatch : Likeness::kNear,
             travelled_m - entry.last_observed_m < options.min_travel_m);
  }
  return vote.result();
}

void EkfSlam::AddLandmark(const LandmarkSighting& sighting, double travelled_m) {
  if (landmarks_.size() >= static_cast<std::size_t>(options_.max_landmarks)) DropLeastUseful();
  const auto measured = LandmarkPoint::Measure(sighting, back_end_.landmarks.noise);
  landmarks_.push_back({state_.AddPoint(measured.z, measured.R_z), sighting.slot, sighting.signature,
                        WrapAngle(state_.robot().theta + sighting.slope), travelled_m, 1, keyframes_.size()});
}

void EkfSlam::DropLeastUseful() {
  const auto least = std::min_element(landmarks_.begin(), landmarks_.end(), [](const Entry& a, const Entry& b) {
    return std::pair(a.sightings, a.last_observed_m) < std::pair(b.sightings, b.last_observed_m);
  });
  const Eigen::Index at = least->at;
  landmarks_.erase(least);
  state_.Remove(at, 2);
  for (Entry& entry : landmarks_)
    if (entry.at > at) entry.at -= 2;
  for (Anchor& anchor : anchors_)
    if (anchor.at > at) anchor.at -= 2;
}

void EkfSlam::Commit() {
  const bool room = anchors_.size() < static_cast<std::size_t>(options_.max_anchors);
  if (anchors_.empty() || (since_anchor_m_ >= options_.anchor_distance_m && room)) {
    anchors_.push_back({state_.AddRobotPose(), keyframes_.size()});
    since_anchor_ = {anchors_.size() - 1, {}, Eigen::Matrix3d::Zero()};
    since_anchor_m_ = 0.0;
  }
  // Updates since the anchor was added have moved the robot relative to the anchor.
  since_anchor_.T_anchor_robot = Between(state_.pose(anchors_[since_anchor_.anchor].at), state_.robot());
  keyframes_.push_back(since_anchor_);
  path_.Append(state_.robot());
  if (moved_path_)
    for (std::size_t k = 0; k < keyframes_.size(); ++k)
      path_.Set(k, state_.pose(anchors_[keyframes_[k].anchor].at) * keyframes_[k].T_anchor_robot);
  moved_path_ = false;
  nis_.EndStep();
}

void EkfSlam::Rebase(std::span<const Pose2> path) {
  for (Entry& entry : landmarks_) {
    const Pose2 correction = path[entry.first_keyframe] * path_[entry.first_keyframe].Inverse();
    state_.SetPoint(entry.at, correction * state_.point(entry.at));
    entry.slope_map = WrapAngle(entry.slope_map + correction.theta);
  }
  for (const Anchor& anchor : anchors_) state_.SetPose(anchor.at, path[anchor.keyframe]);
  state_.SetPose(0, path.back());
  for (std::size_t k = 0; k < path.size(); ++k) {
    keyframes_[k].T_anchor_robot = Between(path[anchors_[keyframes_[k].anchor].keyframe], path[k]);
    path_.Set(k, path[k]);
  }
  since_anchor_.T_anchor_robot = keyframes_.back().T_anchor_robot;
}

// The path follows the loop already, so nothing moves.
void EkfSlam::LearnLoop(const RevisitObservation& loop) {
  const SeenFromAnchor seen = SeeFromAnchor(loop);
  state_.Update<3, 3>(Eigen::Vector3d::Zero(), seen.innovation.J_z_pose, seen.at, seen.J_z_anchor, seen.R);
}

void EkfSlam::MoveTo(std::span<const Pose2> path) {
  const auto turn = [&](std::size_t keyframe) { return AngleDiff(path[keyframe].theta, path_[keyframe].theta); };
  for (const Entry& entry : landmarks_) state_.Turn(entry.at, turn(entry.first_keyframe));
  for (const Anchor& anchor : anchors_) state_.Turn(anchor.at, turn(anchor.keyframe));
  state_.Turn(0, turn(path.size() - 1));
  Rebase(path);
}

FilterHealth EkfSlam::health() const {
  const FilterEstimate now = estimate();
  const bool sound = now.T_map_robot.IsFinite() && IsCovariance(now.covariance, 1e-6);
  return {1.0, nis_.sum(), nis_.numbers(), !sound || contradictions_.diverged()};
}

std::vector<Landmark> EkfSlam::landmarks() const {
  std::vector<Landmark> landmarks;
  for (const Entry& entry : landmarks_)
    landmarks.push_back({entry.slot, entry.signature.corner, state_.point(entry.at), entry.slope_map,
                         state_.covariance<2, 2>(entry.at, entry.at), entry.sightings});
  return landmarks;
}

}  // namespace cairn::slam
