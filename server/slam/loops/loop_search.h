// Finds large loops: places seen so long ago that their position relative to the robot is very uncertain. It
// compares the surfaces seen over the last metres (not one scan) with the surroundings of old keyframes, over
// a search window as wide as the uncertainty. A match is accepted only if no other pose fits nearly as well,
// if no surface lies where beams passed, and if a second comparison some metres later agrees, also without the
// scans of the first one. A late closure is better than a wrong one. Small loops are found by RevisitSearch. Not
// thread-safe. Source: matching by branch and bound as in Hess et al., ICRA 2016; confirmation by agreement between
// closures as in Olson 2009 (Recognizing places using spectrally clustered local matches), in its simplest
// form.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <memory>
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

class StretchMatch;

class LoopSearch {
 public:
  explicit LoopSearch(const LoopOptions& options, const PointToLineOptions& align);
  ~LoopSearch();

  // To be called once after each keyframe. Returns a large loop that the last keyframe closes, if one is confirmed.
  // `path` is the believed path, one pose T_map_robot per keyframe.
  [[nodiscard]] std::optional<LoopClosure> Find(const Trail& trail, const PosePath& path);
  // Whether it is comparing two stretches, or a loop is due to be closed. A comparison is done in parts, one with each
  // scan, whose time is bounded.
  [[nodiscard]] bool busy() const { return comparison_ || due_ == Due::kClose; }
  // To be called after each other scan: does the next part. Returns as Find.
  [[nodiscard]] std::optional<LoopClosure> GoOn(const Trail& trail);

  // The front-end has not followed the robot from the last keyframe to the next one: what was found before says nothing
  // of where the robot is now.
  void ForgetUnconfirmed();
  // Forgets the loops that are not confirmed yet if one of their keyframes is retired, and what is being compared.
  void Retire(const Retirement& retirement);

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.searched_at_m_, self.unconfirmed_);
    if constexpr (Archive::kReads)
      if (archive.format() < 15) return;  // A search that was being done is not gone on with.
    archive(self.candidate_, self.due_, self.comparison_);
    if constexpr (Archive::kReads)
      archive.RequireThat([&] { return self.IsConsistent(); }, "the search for large loops");
  }

 private:
  enum class Due : std::uint8_t { kNothing, kCompare, kConfirm, kClose };
  // Of the surroundings of keyframe `recent`, as seen from keyframe `since` on, with those of `old`. What it has found
  // so far follows from this and from how many parts of it are done, so that a restart does those again.
  struct Comparison {
    std::size_t old = 0;
    std::size_t recent = 0;
    std::size_t since = 0;
    Pose2 T_old_recent_guess;
    double way_m = 0.0;  // From `old` to `recent` along the known relations.
    std::uint32_t parts_done = 0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.old, self.recent, self.since, self.T_old_recent_guess, self.way_m, self.parts_done);
      archive.RequireKeyframe(self.old);
      archive.RequireKeyframe(self.recent);
    }
  };
  [[nodiscard]] bool IsConsistent() const;
  void GoOnComparing(const Trail& trail);
  // Of the comparison that is being done. Returns whether that has ended.
  bool DoPart(const Trail& trail);
  void End(const std::optional<LoopClosure>& found, std::span<const KeyframeShape> shapes);
  // Begins to compare the old keyframe that is the next best candidate.
  void CompareCandidate(const Trail& trail, const PosePath& path);
  // Begins to compare once more what the last comparison has found.
  void Confirm(const Trail& trail, const PosePath& path);
  void GoToNextCandidate();
  [[nodiscard]] std::vector<std::size_t> Candidates(const Trail& trail, const PosePath& path) const;
  // The first unconfirmed loop of an earlier search that agrees with `closure`.
  [[nodiscard]] const LoopClosure* Earlier(const LoopClosure& closure, std::span<const KeyframeShape> shapes) const;
  // The closure with another keyframe of the same stretch as the recent one.
  [[nodiscard]] static LoopClosure SeenFrom(std::size_t keyframe, const LoopClosure& closure,
                                            std::span<const KeyframeShape> shapes);
  [[nodiscard]] bool Agree(const LoopClosure& a, const LoopClosure& b, std::span<const KeyframeShape> shapes) const;
  [[nodiscard]] double Reach(double way_m) const;

  LoopOptions options_;
  PointToLineOptions align_;
  double searched_at_m_ = 0.0;  // Where the last search began.
  // What comparisons have found. Where a confirmed loop is due to be closed, it is the last one.
  std::deque<LoopClosure> unconfirmed_;
  std::uint32_t candidate_ = 0;  // The number of the one with which something is due.
  Due due_ = Due::kNothing;
  std::optional<Comparison> comparison_;
  std::unique_ptr<StretchMatch> match_;  // Of the comparison; null after a restart.
};

}  // namespace cairn::slam
