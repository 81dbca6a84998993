// How a session takes over what a job has drawn of its robot's part of the map: grid, path, pose and past poses
// (session_estimator.h).
#include <span>
#include <utility>
#include <vector>

#include "server/robots/session_estimator.h"

namespace cairn::server {

// The grid before a correction, and the path to go back to with it.
RobotGrid SessionEstimator::DisplacedGrid() {
  const slam::Mapper& mapper = pipeline_.mapper();
  RobotGrid displaced{.chunks = PublishedChunks(),
                      .keyframes = mapper.keyframes_drawn(),
                      .path = {},
                      .numbers = {},
                      .drawn = {},
                      .fragment = fragment_};
  if (auto path = mapper.BestPath(); path.size() == mapper.keyframe_count()) {
    const std::vector<Pose2>& drawn = mapper.drawn_path();
    if (drawn.size() == path.size() && drawn != path)
      displaced.drawn = std::make_shared<const std::vector<Pose2>>(drawn);
    displaced.path = std::make_shared<const std::vector<Pose2>>(std::move(path));
    displaced.numbers = std::make_shared<const std::vector<std::uint64_t>>(mapper.keyframe_numbers());
  }
  return displaced;
}

bool SessionEstimator::AdoptGrid(std::uint32_t epoch, const RobotGrid& grid) {
  slam::Mapper& mapper = pipeline_.mapper();
  const auto path = grid.path != nullptr ? std::span<const Pose2>(*grid.path) : std::span<const Pose2>();
  const auto numbers = grid.numbers != nullptr ? std::span(*grid.numbers) : std::span<const std::uint64_t>();
  const auto drawn = grid.drawn != nullptr ? std::span<const Pose2>(*grid.drawn) : path;
  const std::vector<Pose2> before = mapper.BestPath();
  // A session that was not stored to its end may not be able to follow: then its place in this map is not known.
  // The map of a fragment is in a frame of its own: a grid in another frame does not fit a path that cannot follow.
  const bool adopted = mapper.AdoptGrid(slam::OccupancyGrid(mapper.grid().options(), grid.chunks), grid.keyframes, path,
                                        numbers, fragment_, drawn);
  const bool fragment = grid.fragment || !adopted, was_fragment = fragment_;
  if (fragment && (!fragment_ || !adopted)) driven_m_ = 0.0;  // So that no job joins it again at once.
  fragment_ = fragment;
  T_map_keyframe_.reset();
  // A robot that sends nothing more is where the map version has it as well. (One that is only localised was there when
  // it mapped last, and must be found again.)
  const std::vector<Pose2> after = mapper.BestPath();
  if (!mapper.localises() && !before.empty() && after.size() == before.size())
    record_.MoveLast(after.back() * before.back().Inverse());
  TellJoining();
  if (fragment_ != was_fragment) {
    FollowPath(fragment_);
  } else if (after != before) {
    FollowPath({});
  }
  SetEpoch(epoch);
  return adopted;
}

// No scan will follow. What was seen again since the last large loop has corrected the pose, but not the way to there:
// now the path fits all of it. Called by the same entry of the journal in every server that reads it, after the same
// samples.
void SessionEstimator::FitPath() {
  slam::Mapper& mapper = pipeline_.mapper();
  const std::vector<Pose2> before = mapper.BestPath();
  mapper.SettlePath();
  const std::vector<Pose2> after = mapper.BestPath();
  if (before.empty() || after == before) return;
  record_.MoveLast(after.back() * before.back().Inverse());
  FollowPath({});
  if (!replaying_) outputs_.send(record_.snapshot().status.pose);
}

// What follows is the same whether it comes while the map is drawn or after a restart, which draws it at once.
void SessionEstimator::DrawToTheEnd() {
  while (FinishesMap()) static_cast<void>(pipeline_.mapper().DrawAgain());
}

bool SessionEstimator::DrawLate() {
  slam::Mapper& mapper = pipeline_.mapper();
  const bool finishes = FinishesMap();
  if (!finishes && !mapper.draws_late()) return false;
  const bool more = finishes ? mapper.DrawAgain() : mapper.DrawLate();
  GridChange change = TakeGridChange();
  if (!change.chunks.empty()) outputs_.grid_changed(std::move(change));
  return more;
}

// What has been said of the robot's way so far lies where the path lies now, and so where the grid shows it. What a
// robot did since it is only localised does not hang on its own path.
void SessionEstimator::FollowPath(std::optional<bool> fragment) {
  const slam::Mapper& mapper = pipeline_.mapper();
  path_changed_at_ = mapper.path_changed_at();
  record_.MovePath(mapper.PathByStamps(), !mapper.localises(), fragment);
}

}  // namespace cairn::server
