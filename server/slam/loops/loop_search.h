// Finds large loops: places seen so long ago that their position relative to the robot is very uncertain. It
// compares the surfaces seen over the last metres (not one scan) with the surroundings of old keyframes, over
// a search window as wide as the uncertainty. A match is accepted only if no other pose fits nearly as well,
// if no surface lies where beams passed, and if a second comparison some metres later agrees, also without the
// scans of the first one. A late closure is better than a wrong one. Small loops are found by RevisitSearch. Not
// thread-safe. Source: matching by branch and bound as in Hess et al., ICRA 2016; confirmation by agreement between
// closures as in Olson 2009 (Recognizing places using spectrally clustered local matches), in its simplest
// form.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "server/slam/loops/region.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/trail/pose_path.h"
#include "server/slam/trail/retirement.h"

namespace cairn::slam {

struct LoopOptions {
  bool enabled = true;
  double every_m = 1.0;
  double doubt_per_m = 0.02;
  double doubt_rad_per_m = 0.001;
  double max_doubt_m = 12.0;
  double max_rival = 0.9;
  double max_conflict = 0.10;
  double confirm_after_m = 1.5;
  double sigma_m = 0.1;
  double free_cell_m = 0.2;
};
void Visit(OptionVisitor& visitor, LoopOptions& options);

// The pose of the last keyframe `recent` relative to an old one.
struct LoopClosure {
  std::size_t old = 0;
  std::size_t recent = 0;
  Pose2 T_old_recent;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // (x, y, theta) of T_old_recent.

  [[nodiscard]] PoseRelation relation() const { return {old, recent, T_old_recent, covariance, true}; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.old, self.recent, self.T_old_recent, self.covariance);
    archive.RequireKeyframe(self.old);
    archive.RequireKeyframe(self.recent);
  }
};

class LoopSearch {
 public:
  explicit LoopSearch(const LoopOptions& options, const PointToLineOptions& align);

  // Returns a large loop that the last keyframe closes, once it is confirmed. To be called once after each keyframe,
  // because a search is done in parts, one with each. `path` is the believed path, one pose T_map_robot per keyframe.
  [[nodiscard]] std::optional<LoopClosure> Find(const Trail& trail, const PosePath& path);

  // The front-end has not followed the robot from the last keyframe to the next one: what was found before says nothing
  // of where the robot is now.
  void ForgetUnconfirmed() { unconfirmed_.clear(); }
  // Forgets the loops that are not confirmed yet if one of their keyframes is retired.
  void Retire(const Retirement& retirement);

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.searched_at_m_, self.unconfirmed_);
  }

 private:
  // What a search does with a keyframe: it compares a candidate, or confirms what that comparison has found.
  struct Part {
    std::size_t candidate = 0;
    bool confirms = false;
  };
  // With this keyframe, if the search began with keyframe `began`.
  [[nodiscard]] Part PartAt(std::size_t keyframe, std::size_t began) const;
  // Compares the old keyframe that is the n-th best candidate.
  void CompareCandidate(std::size_t number, const Trail& trail, const PosePath& path);
  [[nodiscard]] std::vector<std::size_t> Candidates(const Trail& trail, const PosePath& path) const;
  // Compares the surroundings of the last keyframe, as seen from keyframe `since` on, with those of `old`.
  [[nodiscard]] std::optional<LoopClosure> Compare(const Trail& trail, std::size_t old, const Pose2& T_old_recent_guess,
                                                   std::size_t since) const;
  // Whether an unconfirmed loop, found before keyframe `before`, agrees with `closure`, and with what has been seen
  // since that one alone.
  [[nodiscard]] bool Confirms(const Trail& trail, const PosePath& path, const LoopClosure& closure,
                              std::size_t before) const;
  // The closure with another keyframe of the same stretch as the recent one.
  [[nodiscard]] static LoopClosure SeenFrom(std::size_t keyframe, const LoopClosure& closure,
                                            std::span<const KeyframeShape> shapes);
  [[nodiscard]] bool Agree(const LoopClosure& a, const LoopClosure& b, std::span<const KeyframeShape> shapes) const;
  [[nodiscard]] double Reach(double way_m) const;

  LoopOptions options_;
  PointToLineOptions align_;
  double searched_at_m_ = 0.0;  // Where the last search began.
  // What comparisons have found. If the last one was found where a search confirms, it is the loop to be closed.
  std::deque<LoopClosure> unconfirmed_;
};

}  // namespace cairn::slam
