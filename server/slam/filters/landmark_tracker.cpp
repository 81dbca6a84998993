#include "server/slam/filters/landmark_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

double SlopeOf(const LandmarkEstimate& landmark) {
  const Eigen::Vector2d d = landmark.extension.mean - landmark.position.mean;
  return std::atan2(d.y(), d.x());
}

}  // namespace

void Visit(OptionVisitor& visitor, LandmarkOptions& options) {
  visitor.Flag("enabled", options.enabled, "Use corners and lines ended on both sides as landmarks.");
  visitor.Integer("min_sightings", options.min_sightings, "1", 1, 100,
                  "Keyframes that must show a feature before it can be a landmark.");
  visitor.Real("same_distance_m", options.same_distance_m, "m", 0.01, 5.0, "Between two sightings of one feature.");
  visitor.Real("same_angle_rad", options.same_angle_rad, "rad", 0.001, 1.0, "... in slope and corner angle.");
  visitor.Real("same_length_m", options.same_length_m, "m", 0.01, 5.0, "... in a line's length.");
  visitor.Real("crowded_m", options.crowded_m, "m", 0.0, 10.0,
               "Like features nearer to each other are nobody's landmark.");
  visitor.Real("match_distance_m", options.match_distance_m, "m", 0.01, 10.0,
               "Between a stable feature and the landmark it may be.");
  visitor.Real("match_slope_rad", options.match_slope_rad, "rad", 0.001, 1.6, "... and their slopes.");
  visitor.Real("match_nis", options.match_nis, "1", 0.1, 1000.0,
               "Squared Mahalanobis distance to it, for the best particle.");
  visitor.Real("min_travel_m", options.min_travel_m, "m", 0.0, 1000.0,
               "Since the landmark's last observation: a feature in view counts once.");
  visitor.Real("forget_m", options.forget_m, "m", 0.1, 1000.0, "Travelled since a candidate's last sighting.");
}

LandmarkTracker::LandmarkTracker(const LandmarkOptions& options, const LandmarkNoise& noise)
    : options_(options), noise_(noise) {}

std::vector<LandmarkObservation> LandmarkTracker::Observe(const ScanFeatures& features, const Pose2& T_track_robot,
                                                          double travelled_m, const Particle& best) {
  std::vector<LandmarkObservation> known, fresh;
  if (!options_.enabled) return known;
  std::erase_if(candidates_, [&](const Candidate& c) { return travelled_m - c.last_seen_m > options_.forget_m; });
  for (const Feature& feature : UsableFeatures(features)) {
    Candidate& candidate = CandidateOf(feature, T_track_robot, travelled_m);
    if (candidate.sightings < options_.min_sightings) continue;
    bool ambiguous = false;
    if (!candidate.id) candidate.id = Recognise(feature, best, ambiguous);
    if (ambiguous) continue;
    LandmarkObservation observation{0, true, feature.p_robot, feature.slope};
    if (candidate.id) {
      observation.id = *candidate.id;
      const bool counts = travelled_m - last_observed_m_[observation.id] >= options_.min_travel_m;
      last_observed_m_[observation.id] = counts ? travelled_m : last_observed_m_[observation.id];
      if (counts) known.push_back(observation);
    } else {
      observation.id = signatures_.size();
      observation.known = false;
      candidate.id = observation.id;
      signatures_.push_back(feature.signature);
      last_observed_m_.push_back(travelled_m);
      fresh.push_back(observation);
    }
  }
  known.insert(known.end(), fresh.begin(), fresh.end());
  return known;
}

// Real corners and lines ended on both sides, without those that have a like one close by (4.4).
std::vector<LandmarkTracker::Feature> LandmarkTracker::UsableFeatures(const ScanFeatures& features) const {
  std::vector<Feature> all;
  for (const CornerFeature& corner : features.corners)
    if (corner.real)
      all.push_back(
          {{true, corner.angle}, corner.position, features.lines[static_cast<std::size_t>(corner.line_a)].slope});
  for (const LineFeature& line : features.lines)
    if (line.ends == EndClass::kBothEnded) all.push_back({{false, line.length}, line.midpoint(), line.slope});
  std::vector<Feature> usable;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool crowded = std::any_of(all.begin(), all.end(), [&](const Feature& other) {
      return &other != &all[i] && Alike(other.signature, all[i].signature) &&
             (other.p_robot - all[i].p_robot).norm() < options_.crowded_m;
    });
    if (!crowded) usable.push_back(all[i]);
  }
  return usable;
}

LandmarkTracker::Candidate& LandmarkTracker::CandidateOf(const Feature& feature, const Pose2& T_track_robot,
                                                         double travelled_m) {
  const Eigen::Vector2d p_track = T_track_robot * feature.p_robot;
  const double slope_track = WrapAngle(T_track_robot.theta + feature.slope);
  for (Candidate& candidate : candidates_) {
    if (!Alike(candidate.signature, feature.signature)) continue;
    if ((candidate.p_track - p_track).norm() > options_.same_distance_m) continue;
    if (std::abs(AngleDiff(candidate.slope_track, slope_track)) > options_.same_angle_rad) continue;
    // Follows its feature: the track frame drifts.
    candidate.p_track = p_track;
    candidate.slope_track = slope_track;
    candidate.last_seen_m = travelled_m;
    ++candidate.sightings;
    return candidate;
  }
  candidates_.push_back({feature.signature, p_track, slope_track, 1, travelled_m, std::nullopt});
  return candidates_.back();
}

bool LandmarkTracker::Alike(const LandmarkSignature& a, const LandmarkSignature& b) const {
  if (a.corner != b.corner) return false;
  return a.corner ? std::abs(AngleDiff(a.shape, b.shape)) < options_.same_angle_rad
                  : std::abs(a.shape - b.shape) < options_.same_length_m;
}

std::optional<std::size_t> LandmarkTracker::Recognise(const Feature& feature, const Particle& best,
                                                      bool& ambiguous) const {
  const Eigen::Vector2d p_map = best.T_map_robot * feature.p_robot;
  const double slope_map = WrapAngle(best.T_map_robot.theta + feature.slope);
  std::optional<std::size_t> found;
  int count = 0;
  // Landmarks of this very scan have signatures already, but no particle has them yet.
  for (std::size_t id = 0; id < best.landmarks.size(); ++id) {
    if (!Alike(signatures_[id], feature.signature)) continue;
    const LandmarkEstimate& landmark = best.landmarks[id];
    if ((landmark.position.mean - p_map).norm() > options_.match_distance_m) continue;
    if (std::abs(AngleDiff(SlopeOf(landmark), slope_map)) > options_.match_slope_rad) continue;
    ++count;
    const RangeBearing predicted = PredictRangeBearing(best.T_map_robot, landmark.position.mean);
    Eigen::Vector2d innovation = MeasureRangeBearing(feature.p_robot) - predicted.z;
    innovation.y() = WrapAngle(innovation.y());
    const Eigen::Matrix2d S = predicted.J_z_pose * best.covariance * predicted.J_z_pose.transpose() +
                              predicted.J_z_point * landmark.position.covariance * predicted.J_z_point.transpose() +
                              noise_.R_z();
    if (innovation.dot(S.inverse() * innovation) < options_.match_nis) found = id;
  }
  // Something like it is there but not where it should be, or several are: neither seen again nor new.
  ambiguous = count > 1 || (count == 1 && !found);
  return ambiguous ? std::nullopt : found;
}

}  // namespace cairn::slam
