// Whether what was read from an archive is a state that SegmentFilter can go on from.
#include <algorithm>

#include "server/slam/dpslam/segment_filter.h"

namespace cairn::slam {

bool SegmentFilter::SegmentsAreConsistent() const {
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    const Segment& segment = segments_[s];
    if (segment.scans == 0 || segment.T_start_end.empty()) return false;
    if (segment.drawn != segment.trajectories.empty()) return false;
    if (!segment.drawn && segment.trajectories.size() != segment.T_start_end.size()) return false;
    for (const Evidence& trajectory : segment.trajectories)
      if (trajectory.size() != segment.scans) return false;
    if (!segment.compared.empty() && segment.compared.size() != segment.T_start_end.size()) return false;
    for (const Evidence& compared : segment.compared)
      if (compared.empty()) return false;
  }
  return true;
}

bool SegmentFilter::CandidatesAreConsistent(const std::vector<Candidate>& candidates) const {
  for (const Candidate& candidate : candidates) {
    if (candidate.parent >= joints_.size() || candidate.joints.size() != segments_.size() - free_) return false;
    for (std::size_t k = 0; k < candidate.joints.size(); ++k)
      if (candidate.joints[k].trajectory >= segments_[free_ + k].T_start_end.size()) return false;
  }
  return true;
}

bool SegmentFilter::IsConsistent() const {
  const std::size_t particles = level_.particles().size(), done = segments_.size() - (at_work_ ? 1 : 0);
  if ((at_work_ && segments_.empty()) || !SegmentsAreConsistent() || joints_.size() != particles) return false;
  for (const SharedSequence<Joint>& joints : joints_) {
    if (joints.size() != done) return false;
    for (std::size_t s = 0; s < done; ++s)
      if (joints[s].trajectory >= segments_[s].T_start_end.size()) return false;
  }
  for (const std::size_t s : open_)
    if (s >= segments_.size() || segments_[s].drawn || segments_[s].compared.empty()) return false;
  if (!at_work_) return true;
  if (free_ >= segments_.size() || open_.empty() || open_.front() < free_ || moves_left_ < 0 || moves_left_ > kMoves)
    return false;
  for (std::size_t s = free_; s < segments_.size(); ++s)
    if (segments_[s].drawn || !std::is_sorted(open_.begin(), open_.end())) return false;
  if (candidates_.size() != particles || !CandidatesAreConsistent(candidates_)) return false;
  if (!proposed_.empty() && (proposed_.size() != particles || !CandidatesAreConsistent(proposed_))) return false;
  if (log_likelihoods_.size() >= particles * open_.size()) return false;
  for (const std::size_t s : to_draw_)
    if (s >= free_ || segments_[s].drawn) return false;
  if (to_draw_.empty()) return true;
  if (drawings_.distinct.empty() || children_.size() >= drawings_.distinct.size()) return false;
  if (drawings_.of_particle.size() != particles) return false;
  for (const std::size_t index : drawings_.of_particle)
    if (index >= drawings_.distinct.size()) return false;
  for (std::size_t i = 0; i < drawings_.distinct.size(); ++i) {
    const MapSample& sample = drawings_.distinct[i];
    if (sample.map >= level_.maps().count() || sample.evidence >= segments_[to_draw_.back()].T_start_end.size())
      return false;
    if (i > 0 && sample.map < drawings_.distinct[i - 1].map) return false;
    if (i < children_.size() && children_[i].parent != sample.map) return false;
  }
  return true;
}

}  // namespace cairn::slam
