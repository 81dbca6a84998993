// Where a mapper's path lies by stamps, for those who keep poses that were reported before it was corrected, and how
// the map is drawn where no scan does it (mapper.h).
#include "server/slam/mapper_state.h"

namespace cairn::slam {

Trajectory Mapper::PathByStamps() const {
  const State& s = *state_;
  Trajectory along;
  if (!s.filter->placed()) return along;
  const std::vector<Pose2> path = s.believed_path().values();
  std::size_t last = path.size();
  for (const MapperSnapshot::ScanPlace& scan : s.trail.scans()) {
    if (scan.keyframe != last) along.push_back({scan.stamp, path[scan.keyframe] * scan.T_keyframe_robot});
    last = scan.keyframe;
  }
  return along;
}

Mapper::DrawnKeyframes Mapper::drawn_keyframes() const {
  const State& s = *state_;
  const std::vector<Pose2>& path = s.drawing.path();
  DrawnKeyframes drawn;
  if (path.size() != s.trail.size()) return drawn;
  for (std::size_t k = 0; k < path.size(); ++k) {
    if (!s.trail.keyframes()[k].localized) continue;
    drawn.numbers.push_back(s.trail.shapes()[k].number);
    drawn.path.push_back(path[k]);
  }
  return drawn;
}

bool Mapper::DrawLate() {
  State& s = *state_;
  s.drawing.DrawLate(s.trail.keyframes());
  return s.drawing.late();
}

bool Mapper::draws_late() const {
  return state_->drawing.late();
}

void Mapper::SettlePath() {
  state_->SettlePath();
}

bool Mapper::DrawAgain() {
  State& s = *state_;
  s.drawing.Continue(s.trail.keyframes(), s.believed_path());
  return s.drawing.redrawing();
}

bool Mapper::draws_again() const {
  return state_->drawing.redrawing();
}

void Mapper::FinishMap() {
  SettlePath();
  state_->drawing.Finish(state_->trail.keyframes(), state_->believed_path());
}

std::uint64_t Mapper::keyframes_drawn() const {
  const State& s = *state_;
  const std::size_t drawn = s.drawing.drawn();
  return drawn < s.drawing.path().size() ? s.trail.shapes()[drawn].number : s.trail.made();
}

const std::vector<Pose2>& Mapper::drawn_path() const {
  return state_->drawing.path();
}

std::uint64_t Mapper::path_changed_at() const {
  return state_->drawing.changed_at();
}

}  // namespace cairn::slam
