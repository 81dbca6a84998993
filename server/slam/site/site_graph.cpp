#include "server/slam/site/site_graph.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>

#include "server/slam/site/consistent_set.h"

namespace cairn::slam {
namespace {

// What a person who says where a robot starts may be wrong by. Where robots have seen the same, their relations decide.
// Where they meet only beyond a corridor, the scale of the wheels is as wrong as a start may be, over all of its
// length, and the steps know only of errors that have nothing to do with each other; so a start must count against
// them.
constexpr double kStartSigmaM = 0.1;
constexpr double kStartSigmaRad = 0.02;

}  // namespace

SiteGraph::SiteGraph(std::span<const SessionMap* const> maps, std::vector<bool> start_known,
                     const PoseGraphOptions& options)
    : maps_(maps.begin(), maps.end()),
      start_known_(std::move(start_known)),
      options_(options),
      frames_(maps.size()),
      placed_in_(maps.size()),
      withdrawn_(maps.size(), 0) {
  for (const SessionMap* map : maps_) paths_.push_back(map->own_path());
  std::iota(frames_.begin(), frames_.end(), std::size_t{0});
  placed_in_ = frames_;
}

void SiteGraph::Add(std::span<const SessionRelation> relations) {
  relations_.insert(relations_.end(), relations.begin(), relations.end());
  UpdateFrames();
}

void SiteGraph::RemoveBetween(std::size_t a, std::size_t b) {
  std::erase_if(relations_, [a, b](const SessionRelation& one) {
    return (one.from.session == a && one.to.session == b) || (one.from.session == b && one.to.session == a);
  });
  UpdateFrames();
}

std::size_t SiteGraph::CountOf(std::size_t session) const {
  return static_cast<std::size_t>(std::ranges::count_if(relations_, [session](const SessionRelation& one) {
    return one.from.session == session || one.to.session == session;
  }));
}

void SiteGraph::UpdateFrames() {
  std::iota(frames_.begin(), frames_.end(), std::size_t{0});
  for (bool changed = true; std::exchange(changed, false);) {
    for (const SessionRelation& one : relations_) {
      std::size_t& a = frames_[one.from.session];
      std::size_t& b = frames_[one.to.session];
      changed = changed || a != b;
      a = b = std::min(a, b);
    }
  }
  // So far each has the lowest number of its group.
  const std::vector<std::size_t> lowest = frames_;
  for (std::size_t s = 0; s < size(); ++s) {
    for (std::size_t other = 0; other < size(); ++other) {
      if (lowest[other] != lowest[s] || !start_known_[other]) continue;
      frames_[s] = other;
      break;
    }
  }
}

std::vector<std::size_t> SiteGraph::GroupOf(std::size_t frame) const {
  std::vector<std::size_t> group{frame};
  for (std::size_t s = 0; s < size(); ++s)
    if (s != frame && frames_[s] == frame) group.push_back(s);
  return group;
}

// Puts sessions that are new in the group to where one of their relations says.
void SiteGraph::Place(const std::vector<std::size_t>& group) {
  const std::size_t frame = group.front();
  for (const std::size_t s : group) {
    if (placed_in_[s] == frame) continue;
    paths_[s] = maps_[s]->own_path();
    placed_in_[s] = s;
  }
  if (placed_in_[frame] != frame) {
    paths_[frame] = maps_[frame]->own_path();
    placed_in_[frame] = frame;
  }
  const auto move = [&](std::size_t session, const Pose2& T_site_keyframe, std::size_t keyframe) {
    const Pose2 T_site_own = T_site_keyframe * paths_[session][keyframe].Inverse();
    for (Pose2& pose : paths_[session]) pose = T_site_own * pose;
    placed_in_[session] = frame;
  };
  for (bool placed = true; std::exchange(placed, false);) {
    for (const SessionRelation& one : relations_) {
      const auto [a, b] = std::pair{one.from, one.to};
      if (frames_[a.session] != frame) continue;
      const bool has_a = placed_in_[a.session] == frame, has_b = placed_in_[b.session] == frame;
      if (has_a == has_b) continue;
      if (has_a)
        move(b.session, paths_[a.session][a.keyframe] * one.T_from_to, b.keyframe);
      else
        move(a.session, paths_[b.session][b.keyframe] * one.T_from_to.Inverse(), a.keyframe);
      placed = true;
    }
  }
}

bool SiteGraph::BeginWithLastPaths(const RelationBook& book) {
  bool all = true;
  for (std::size_t s = 0; s < size(); ++s)
    if (CountOf(s) > 0) all = BeginWithLastPath(s, book) && all;
  return all;
}

// The keyframes since then follow the last one that was known. Where the session's own path is another one now, the
// last job's is of no use.
bool SiteGraph::BeginWithLastPath(std::size_t session, const RelationBook& book) {
  constexpr double kSameShapeM = 0.5;
  const SessionMap& map = *maps_[session];
  const SessionMap& frame = *maps_[frames_[session]];
  const SolvedPath* const last = book.PathOf(map.session());
  const SolvedPath* const of_frame = book.PathOf(frame.session());
  if (last == nullptr || of_frame == nullptr) return false;
  if (last->frame != frame.session() || of_frame->frame != last->frame) return false;
  if (of_frame->keyframes.front() != frame.id(0)) return false;  // The frame is where that one is.
  const Pose2 T_site_last = frame.own_path().front() * of_frame->path.front().Inverse();
  std::vector<std::optional<Pose2>> known(map.size());
  for (std::size_t i = 0; i < last->keyframes.size(); ++i)
    if (const auto k = map.IndexOf(last->keyframes[i])) known[*k] = T_site_last * last->path[i];
  if (known.empty() || !known.front()) return false;
  const std::vector<Pose2>& own = map.own_path();
  const Pose2 T_site_own = *known.front() * own.front().Inverse();
  std::vector<Pose2> path;
  path.reserve(map.size());
  for (std::size_t k = 0; k < map.size(); ++k) {
    path.push_back(known[k] ? *known[k] : path.back() * Between(own[k - 1], own[k]));
    if ((path[k].translation() - (T_site_own * own[k]).translation()).norm() > kSameShapeM) return false;
  }
  paths_[session] = std::move(path);
  placed_in_[session] = frames_[session];
  return true;
}

void SiteGraph::NotePaths(RelationBook& book) const {
  for (std::size_t s = 0; s < size(); ++s) {
    const std::uint64_t session = maps_[s]->session();
    if (CountOf(s) == 0) {
      book.ForgetPath(session);
      continue;
    }
    SolvedPath solved{.frame = maps_[frames_[s]]->session(), .keyframes = {}, .path = paths_[s]};
    solved.keyframes.reserve(maps_[s]->size());
    for (std::size_t k = 0; k < maps_[s]->size(); ++k) solved.keyframes.push_back(maps_[s]->id(k));
    book.SetPath(session, std::move(solved));
  }
}

bool SiteGraph::Solve(const GoOn& go_on) {
  for (std::size_t s = 0; s < size(); ++s) {
    if (frames_[s] != s) continue;
    const std::vector<std::size_t> group = GroupOf(s);
    Place(group);
    if (group.size() > 1 && !SolveGroup(group, go_on)) return false;
  }
  return true;
}

bool SiteGraph::SolveGroup(const std::vector<std::size_t>& group, const GoOn& go_on) {
  std::vector<std::size_t> first(size(), 0);  // The number of a session's first node.
  std::vector<Pose2> poses;
  std::vector<PoseRelation> relations;
  for (const std::size_t s : group) {
    first[s] = poses.size();
    poses.insert(poses.end(), paths_[s].begin(), paths_[s].end());
    for (PoseRelation relation : maps_[s]->relations()) {
      relation.from += first[s];
      relation.to += first[s];
      relations.push_back(relation);
    }
    // A start may be wrong, as a loop may be.
    const std::size_t frame = group.front();
    if (s != frame && start_known_[s] && start_known_[frame])
      relations.push_back({first[frame], first[s], Between(maps_[frame]->own_path()[0], maps_[s]->own_path()[0]),
                           PoseCovariance(kStartSigmaM, kStartSigmaRad), true});
  }
  for (const SessionRelation& one : relations_)
    if (frames_[one.from.session] == group.front())
      relations.push_back({first[one.from.session] + one.from.keyframe, first[one.to.session] + one.to.keyframe,
                           one.T_from_to, one.covariance, true});
  if (OptimisePoses(poses, relations, options_, go_on).cancelled) return false;
  for (const std::size_t s : group) {
    const auto begin = poses.begin() + static_cast<std::ptrdiff_t>(first[s]);
    std::copy(begin, begin + static_cast<std::ptrdiff_t>(paths_[s].size()), paths_[s].begin());
  }
  return true;
}

std::size_t SiteGraph::WithdrawOutvoted() {
  const std::size_t before = relations_.size();
  std::erase_if(relations_, [this](const SessionRelation& one) {
    const Eigen::Vector3d error =
        ErrorOf({0, 0, one.T_from_to, one.covariance, true}, paths_[one.from.session][one.from.keyframe],
                paths_[one.to.session][one.to.keyframe])
            .error;
    if (error.dot(one.covariance.ldlt().solve(error)) <= kMaxChiSquare) return false;
    ++withdrawn_[one.from.session];
    ++withdrawn_[one.to.session];
    return true;
  });
  UpdateFrames();
  return before - relations_.size();
}

}  // namespace cairn::slam
