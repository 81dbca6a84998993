// One pose graph over the keyframes of all sessions of a site: the relations within each session, those between
// sessions, and the starts that are known. Sessions that are related to each other, also through others, are a group
// and have one frame, that of the group's first session whose start is known, or of its first session. Each group is
// solved for itself; a session without relations stays as it is. Copies are cheap enough to try something and to take
// it back. Not thread-safe, deterministic. Source: Lu and Milios 1997; robust loss, and relations that remain outliers
// are withdrawn (graph/pose_graph.h).
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "server/slam/site/relation_search.h"
#include "server/slam/site/session_map.h"

namespace cairn::slam {

class SiteGraph {
 public:
  // `start_known`: one per session. The maps must outlive the graph.
  SiteGraph(std::span<const SessionMap* const> maps, std::vector<bool> start_known, const PoseGraphOptions& options);

  void Add(std::span<const SessionRelation> relations);
  // Removes the relations between two sessions.
  void RemoveBetween(std::size_t a, std::size_t b);
  // The search for the best paths begins where the last job has put the sessions (RelationBook::PathOf). False: some
  // that are related to others have no such path, or not in the frame in which they are now.
  bool BeginWithLastPaths(const RelationBook& book);
  // Those of the next job.
  void NotePaths(RelationBook& book) const;
  // Moves all paths to fit the relations best. False: `go_on` returned false, and the graph must not be used any more.
  [[nodiscard]] bool Solve(const GoOn& go_on);
  // Removes the relations between sessions that the paths contradict, and returns how many. They have been outvoted.
  std::size_t WithdrawOutvoted();

  [[nodiscard]] std::size_t size() const { return maps_.size(); }
  [[nodiscard]] const SessionMap& map(std::size_t session) const { return *maps_[session]; }
  [[nodiscard]] bool start_known(std::size_t session) const { return start_known_[session]; }
  // The session in whose frame this one lies: itself if it is related to no other, or if it is the group's first.
  [[nodiscard]] std::size_t frame_of(std::size_t session) const { return frames_[session]; }
  [[nodiscard]] bool Together(std::size_t a, std::size_t b) const { return frames_[a] == frames_[b]; }
  [[nodiscard]] const std::vector<Pose2>& path(std::size_t session) const { return paths_[session]; }
  [[nodiscard]] std::span<const SessionRelation> relations() const { return relations_; }
  [[nodiscard]] std::size_t CountOf(std::size_t session) const;
  [[nodiscard]] std::size_t WithdrawnOf(std::size_t session) const { return withdrawn_[session]; }

 private:
  void UpdateFrames();
  bool BeginWithLastPath(std::size_t session, const RelationBook& book);
  [[nodiscard]] std::vector<std::size_t> GroupOf(std::size_t frame) const;
  void Place(const std::vector<std::size_t>& group);
  [[nodiscard]] bool SolveGroup(const std::vector<std::size_t>& group, const GoOn& go_on);

  std::vector<const SessionMap*> maps_;
  std::vector<bool> start_known_;
  PoseGraphOptions options_;
  std::vector<SessionRelation> relations_;
  std::vector<std::vector<Pose2>> paths_;  // T_site_robot per keyframe of each session.
  std::vector<std::size_t> frames_;
  std::vector<std::size_t> placed_in_;  // The frame in which the path lies at present.
  std::vector<std::size_t> withdrawn_;
};

}  // namespace cairn::slam
