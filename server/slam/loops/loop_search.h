// Finds large loops: places seen so long ago that their position relative to the robot is very uncertain. It
// compares the surfaces seen over the last metres (not one scan) with the surroundings of old keyframes, over
// a search window as wide as the uncertainty. A match is accepted only if no other pose fits nearly as well,
// if no surface lies where beams passed, and if a second comparison some metres later agrees. It prefers a
// late closure to a wrong one. Small loops are found by RevisitSearch. Not thread-safe.
// Source: matching by branch and bound as in Hess et al., ICRA 2016; confirmation by agreement between
// closures as in Olson 2009 (Recognizing places using spectrally clustered local matches), in its simplest
// form.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "server/slam/loops/region.h"
#include "server/slam/loops/region_search.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/trail/pose_path.h"

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

// An old keyframe in whose surroundings the robot may be, and where it may be there.
struct LoopCandidate {
  std::size_t old = 0;
  SearchWindow window;  // T_old_recent.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.old, self.window.T_ref_curr_centre, self.window.reach_m, self.window.reach_rad);
    archive.RequireKeyframe(self.old);
    archive.Require(self.window.T_ref_curr_centre.translation().cwiseAbs().maxCoeff() <= kMostDoubtM &&
                        0.0 <= self.window.reach_m && self.window.reach_m <= kMostDoubtM &&
                        0.0 <= self.window.reach_rad && self.window.reach_rad <= kPi,
                    "where a loop is looked for");
  }
  static constexpr double kMostDoubtM = 30.0;  // Upper bound of LoopOptions::max_doubt_m.
};

class StretchMatch;

// A search takes as long as hundreds of scans, so it is spread over the scans that follow.
class LoopSearch {
 public:
  LoopSearch(const LoopOptions& options, const PointToLineOptions& align);
  ~LoopSearch();
  LoopSearch(const LoopSearch&) = delete;
  LoopSearch& operator=(const LoopSearch&) = delete;

  // Begins a search around the last keyframe, if one is due and none goes on. `path` is the believed path, one pose
  // T_map_robot per keyframe.
  void Begin(const Trail& trail, const PosePath& path);
  [[nodiscard]] bool searching() const { return !candidates_.empty(); }
  // Goes on with the search by a fixed amount of work. Returns a large loop, once one is confirmed.
  [[nodiscard]] std::optional<LoopClosure> GoOn(const Trail& trail);

  // A search that goes on is saved by what it searches and how far it has come.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.searched_at_m_, self.unconfirmed_, self.recent_, self.candidates_, self.work_done_, self.found_);
    if (self.searching()) archive.RequireKeyframe(self.recent_);
    constexpr std::int64_t kMostWork = 1'000'000'000'000;
    archive.Require(0 <= self.work_done_ && self.work_done_ <= kMostWork, "the search for a loop");
  }

 private:
  [[nodiscard]] std::vector<std::size_t> Candidates(const Trail& trail, const PosePath& path) const;
  [[nodiscard]] std::unique_ptr<StretchMatch> Compare(std::span<const KeyframeShape> shapes) const;
  [[nodiscard]] std::optional<LoopClosure> Confirmed(std::span<const KeyframeShape> shapes);
  [[nodiscard]] bool Agree(const LoopClosure& a, const LoopClosure& b, std::span<const KeyframeShape> shapes) const;
  [[nodiscard]] double Reach(double way_m) const;

  LoopOptions options_;
  PointToLineOptions align_;
  double searched_at_m_ = 0.0;
  std::deque<LoopClosure> unconfirmed_;
  // The search that goes on.
  std::size_t recent_ = 0;                // The keyframe around which it searches.
  std::deque<LoopCandidate> candidates_;  // Those that have not been compared, the most likely first.
  std::int64_t work_done_ = 0;            // In the comparison with the first of them.
  std::vector<LoopClosure> found_;
  std::unique_ptr<StretchMatch> comparison_;
};

}  // namespace cairn::slam
