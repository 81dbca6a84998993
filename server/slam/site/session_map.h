// One session of a site as the joint smoothing uses it: its keyframes along its own smoothed path. Within a session
// this path is exact over some tens of metres, so it takes the place of the front-end's frame for all searches. Frames:
// `own` is the map frame of the session before the smoothing; `site` is the common frame of sessions that are joined.
// Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/graph/pose_graph.h"
#include "server/slam/recovery/place_search.h"
#include "server/slam/site/relation_book.h"
#include "server/slam/site/site_options.h"
#include "server/slam/trail/keyframe.h"
#include "server/slam/trail/pose_path.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// A keyframe of one of the sessions, each by its index.
struct SessionKeyframe {
  std::size_t session = 0;
  std::size_t keyframe = 0;

  bool operator==(const SessionKeyframe&) const = default;
};

// How two keyframes of different sessions lie relative to each other, measured by matching what was seen from them.
struct SessionRelation {
  SessionKeyframe from;
  SessionKeyframe to;
  Pose2 T_from_to;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // (x, y, theta) of T_from_to, in `from`.

  bool operator==(const SessionRelation&) const = default;
};

class SessionMap {
 public:
  // `own_path`: one pose T_own_robot per keyframe of `snapshot`.
  // `session`: its id, which no other of the site has.
  SessionMap(std::uint64_t session, const MapperSnapshot& snapshot, std::vector<Pose2> own_path,
             const SiteOptions& options);

  [[nodiscard]] std::uint64_t session() const { return session_; }
  [[nodiscard]] std::size_t size() const { return own_path_.size(); }
  // How many keyframes there have been, with those that were retired.
  [[nodiscard]] std::uint64_t made() const { return ids_.empty() ? 0 : ids_.back().number + 1; }
  [[nodiscard]] const KeyframeId& id(std::size_t keyframe) const { return ids_[keyframe]; }
  // Nothing: it was retired, or the session has another keyframe of this number.
  [[nodiscard]] std::optional<std::size_t> IndexOf(const KeyframeId& id) const;
  [[nodiscard]] const Trail& trail() const { return trail_; }
  [[nodiscard]] const std::vector<Pose2>& own_path() const { return own_path_; }
  [[nodiscard]] double travelled_m(std::size_t keyframe) const { return trail_.shapes()[keyframe].travelled_m; }
  [[nodiscard]] bool localized(std::size_t keyframe) const { return trail_.keyframes()[keyframe].localized; }
  // The steps, revisits and loops of the session.
  [[nodiscard]] std::span<const PoseRelation> relations() const { return relations_; }

  // The last localized keyframe within `way_m` of the way after this one; itself if there is none.
  [[nodiscard]] std::size_t LastAround(std::size_t keyframe, double way_m) const;
  // What is seen within `way_m` of the way to either side of a keyframe. Keyframes that are not localized are left out.
  [[nodiscard]] std::vector<RecentScan> ScansAround(std::size_t keyframe, double way_m) const;
  // The place of the last of these scans in `own`, if it is like no other place there.
  [[nodiscard]] std::optional<FoundPlace> Find(std::span<const RecentScan> scans);
  // The same as PlaceSearch, in `own`.
  [[nodiscard]] double ScoreAt(std::span<const RecentScan> scans, const Pose2& T_own_robot) {
    return places_.ScoreAt(map(), scans, T_own_robot);
  }
  [[nodiscard]] bool FitsElsewhere(std::span<const RecentScan> scans, const Pose2& T_own_robot, double score) {
    return places_.FitsElsewhere(map(), scans, T_own_robot, score);
  }
  // The localized keyframe nearest to a pose in `own`. REQUIRES: there is one.
  [[nodiscard]] std::size_t NearestTo(const Pose2& T_own_robot) const;
  // Frees the tables of the search for places.
  void ForgetPlaces() { places_.Forget(); }

 private:
  [[nodiscard]] PathMap map() const { return {trail_, shared_own_path_, place_, near_m_, middle_}; }

  std::uint64_t session_;
  std::vector<PoseRelation> relations_;
  std::vector<Pose2> own_path_;
  PosePath shared_own_path_;  // The same poses.
  Trail trail_;
  std::vector<KeyframeId> ids_;  // Of the keyframes.
  PlaceSearchOptions place_;
  Eigen::Vector2d middle_;  // Of the own path.
  double near_m_;
  PlaceSearch places_;
};

}  // namespace cairn::slam
