#include "server/slam/landmarks/landmark_candidates.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

std::vector<LandmarkSighting> LandmarkCandidates::Observe(const ScanFeatures& features, const Pose2& T_track_robot,
                                                          double travelled_m) {
  std::vector<LandmarkSighting> due;
  if (!options_.enabled) return due;
  std::erase_if(candidates_, [&](const Candidate& c) { return travelled_m - c.last_seen_m > options_.forget_m; });
  for (const Feature& feature : UsableFeatures(features)) {
    Candidate& candidate = CandidateOf(feature, T_track_robot, travelled_m);
    if (candidate.sightings < options_.min_sightings) continue;
    if (candidate.slot >= 0 && travelled_m - candidate.last_shown_m < options_.min_travel_m) continue;
    if (candidate.slot < 0) candidate.slot = NextSlot();
    candidate.last_shown_m = travelled_m;
    due.push_back({static_cast<std::size_t>(candidate.slot), feature.signature, feature.p_robot, feature.slope});
  }
  return due;
}

std::ptrdiff_t LandmarkCandidates::NextSlot() {
  if (free_.empty()) return slots_++;
  const std::ptrdiff_t slot = free_.back();
  free_.pop_back();
  return slot;
}

void LandmarkCandidates::GiveAgain(const std::vector<bool>& used) {
  std::vector<bool> taken = used;
  for (const Candidate& candidate : candidates_)
    if (candidate.slot >= 0) taken[static_cast<std::size_t>(candidate.slot)] = true;
  free_.clear();
  for (std::size_t slot = taken.size(); slot-- > 0;)
    if (!taken[slot]) free_.push_back(static_cast<std::ptrdiff_t>(slot));
}

// Real corners and lines ended on both sides, without those that have a similar one close by (4.4).
std::vector<LandmarkCandidates::Feature> LandmarkCandidates::UsableFeatures(const ScanFeatures& features) const {
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
      return &other != &all[i] && Alike(other.signature, all[i].signature, options_) &&
             (other.p_robot - all[i].p_robot).norm() < options_.crowded_m;
    });
    if (!crowded) usable.push_back(all[i]);
  }
  return usable;
}

LandmarkCandidates::Candidate& LandmarkCandidates::CandidateOf(const Feature& feature, const Pose2& T_track_robot,
                                                               double travelled_m) {
  const Eigen::Vector2d p_track = T_track_robot * feature.p_robot;
  const double slope_track = WrapAngle(T_track_robot.theta + feature.slope);
  for (Candidate& candidate : candidates_) {
    if (!Alike(candidate.signature, feature.signature, options_)) continue;
    if ((candidate.p_track - p_track).norm() > options_.same_distance_m) continue;
    if (std::abs(AngleDiff(candidate.slope_track, slope_track)) > options_.same_angle_rad) continue;
    // The candidate moves to the new position of its feature, because the track frame drifts.
    candidate.p_track = p_track;
    candidate.slope_track = slope_track;
    candidate.last_seen_m = travelled_m;
    ++candidate.sightings;
    return candidate;
  }
  candidates_.push_back({feature.signature, p_track, slope_track, 1, travelled_m, -1, 0.0});
  return candidates_.back();
}

}  // namespace cairn::slam
